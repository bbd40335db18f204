"""Ask a saved model what it says of readings that it has not seen."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from app.analysis import load_rows
from app.files.fits import SavedFit, read_fit
from app.files.residuals import write_residuals
from app.jobs.carried_over import known_to, same_machine
from app.jobs.chosen_runs import File, Runs, names_of, path_of
from app.jobs.fitting import BadReadingEntry, RemarkEntry
from app.jobs.record import Record, Report
from calib.arrays import Array, BoolArray
from calib.digits import length, turn
from calib.identify.predicting import Prediction, shift_of_frames
from calib.identify.predicting import predict as predicted
from calib.model.prediction import Model
from calib.runs.remark import plain_remarks
from calib.runs.stack import Rows

WORST = 8
"""Readings that are named as the worst."""
DOUBTFUL = 1e-3
"""p-value below which a run is said not to be as the model has it."""


@dataclass(frozen=True, kw_only=True)
class AxisEntry(Record):
    """Residuals along one axis of the base frame, platform readings, um."""

    axis: str
    mean_um: float
    rms_um: float
    expected_um: float


@dataclass(frozen=True, kw_only=True)
class NestEntry(Record):
    """Residuals (3D) of the readings of one nest, um; ``on`` platform or base."""

    nest: str
    on: str
    readings: int
    rms_um: float
    expected_um: float


@dataclass(frozen=True, kw_only=True)
class WorstReadingEntry(Record):
    """A reading that is far off: ``times_expected`` noise and model uncertainty, base frame."""

    run: str
    line: int
    pose: str
    nest: str
    shift_um: tuple[float, ...]
    distance_um: float
    times_expected: float


@dataclass(frozen=True, kw_only=True)
class PredictReport(Report):
    """A model on a run that it has not seen (``pkm-predict/1``).

    RMS of the 3D distance over platform readings, um; ``expected_um`` is what noise and the model's
    own uncertainty would leave, ``noise_um`` what noise alone would; ``ratio`` is rms over
    expected. ``p_value``: probability that they leave as large a chi-square.
    """

    FORMAT: ClassVar[str] = "pkm-predict/1"
    model: str
    machine: str
    effects: tuple[str, ...]
    frame: str
    readings: int
    rms_um: float | None
    expected_um: float | None
    noise_um: float | None
    ratio: float | None
    chi2_per_dof: float | None
    log10_p: float | None
    p_value: float | None
    axes: tuple[AxisEntry, ...]
    nests: tuple[NestEntry, ...]
    worst: tuple[WorstReadingEntry, ...]
    not_in_model: tuple[str, ...]
    bad_readings: tuple[BadReadingEntry, ...]
    left_out_readings: int
    remarks: tuple[str, ...]
    record: tuple[RemarkEntry, ...]
    advice: str
    _found: Prediction = field(repr=False, compare=False)
    _runs: tuple[str, ...] = field(repr=False, compare=False)

    def residuals(self, file: File) -> None:
        """Write measured minus predicted of every reading as CSV.

        Raises
        ------
        BadInput
            If the file would lie in a run's folder.
        """
        found = self._found
        write_residuals(Path(file), found.model, found.linear, found.bad, self._runs)


def predict(model: File, runs: Runs, *, frame: bool = False) -> PredictReport:
    """Predict the readings of runs from a saved model: nothing is fitted to them.

    Parameters
    ----------
    model : path
        Model file of ``fit`` or ``discover``.
    runs : path or sequence of paths
        Run folders of the same machine.
    frame : bool
        Fit the place of the tracker, and nothing else, to each run. Without it the tracker is
        taken to stand where it stood for the model.

    Returns
    -------
    PredictReport

    Raises
    ------
    BadInput
        If the model is of another machine, lacks its frame or parameters, or names the place of
        what cannot be read.

    Examples
    --------
    >>> seen = pkmcal.predict("model.toml", "new_run", frame=True)           # doctest: +SKIP
    >>> seen.rms_um, seen.ratio                                              # doctest: +SKIP
    (9.1, 1.02)
    """
    path, names = path_of(model), names_of(runs)
    assert path is not None
    saved = read_fit(path)
    rows, effects = load_rows(names, (), path)
    shown = effects[len(saved.effects) :]  # those that the record itself shows are not the model's
    asked = Model(rows, effects[: len(saved.effects)])
    same_machine(saved, asked)
    remarks = [
        f"{one.id} shows in the readings and is not in the model: nothing makes up for it"
        for one in shown
    ]
    known, lacking = known_to(saved, asked, frame, remarks)
    found = predicted(asked, known, refit=frame)
    said = _said(saved, found, lacking, remarks)
    return PredictReport.of(said, _found=found, _runs=names)


def _said(
    saved: SavedFit, found: Prediction, lacking: tuple[str, ...], remarks: list[str]
) -> dict[str, Any]:
    rows, accepted = found.model.rows, found.accepted
    told = accepted & rows.in_millimetres.any(axis=0)
    judged = told & rows.on_platform
    judged = judged if judged.any() else told
    rms, expected = _rms(found, judged)
    noise = _root_um(np.sum(_in_mm2(rows.covariance, rows), axis=0)[judged])
    moved = [] if found.refitted else _frame_words(found)
    log_p = found.log_p
    return {
        "format": PredictReport.FORMAT,
        "model": saved.source,
        "machine": found.model.machine.name,
        "effects": [effect.id for effect in found.model.effects],
        "frame": "fitted to these runs" if found.refitted else "of the model",
        "readings": int(accepted.sum()),
        "rms_um": rms,
        "expected_um": expected,
        "noise_um": noise,
        "ratio": rms / expected if expected else None,
        "chi2_per_dof": found.chi2 / found.dof if found.dof > 0 else None,
        "log10_p": log_p / math.log(10.0),
        "p_value": math.exp(log_p),
        "axes": [_axis(found, judged & rows.placed, k) for k in range(3)],
        "nests": [_nest(found, *nest) for nest in _nests(found)],
        "worst": _worst(found),
        "not_in_model": list(lacking),
        "bad_readings": [_bad(found, one) for one in found.bad],
        "left_out_readings": int(found.model.lacking.sum()),
        "remarks": [*remarks, *moved],
        "record": plain_remarks(rows.remarks),
        "advice": _advice(rms, expected, log_p, bool(moved)),
    }


def _root_um(squares: Array) -> float:
    return 1000.0 * float(np.sqrt(np.mean(squares))) if squares.size else math.nan


def _in_mm2(covariance: Array, rows: Rows) -> Array:
    """Variances (3, N) of the components that say something in mm; zero for the others."""
    return np.asarray(np.einsum("iin->in", covariance) * rows.in_millimetres)


def _rms(found: Prediction, which: BoolArray) -> tuple[float, float]:
    rows = found.model.rows
    squares = np.sum(found.linear.residual**2 * rows.in_millimetres, axis=0)
    allowed = np.sum(_in_mm2(found.covariance, rows), axis=0)
    return _root_um(squares[which]), _root_um(allowed[which])


def _axis(found: Prediction, which: BoolArray, k: int) -> dict[str, Any]:
    along = found.residual_in_base[k, which]
    return {
        "axis": "xyz"[k],
        "mean_um": 1000.0 * float(np.mean(along)) if along.size else math.nan,
        "rms_um": _root_um(along**2),
        "expected_um": _root_um(found.covariance_in_base[k, k, which]),
    }


def _nests(found: Prediction) -> list[tuple[str, bool]]:
    """Nests that were read, those of the platform first."""
    rows = found.model.rows
    told = np.flatnonzero(found.accepted & rows.in_millimetres.any(axis=0))
    read = dict.fromkeys((rows.nest_name[k], bool(rows.on_platform[k])) for k in told)
    return sorted(read, key=lambda one: not one[1])


def _nest(found: Prediction, nest: str, on_platform: bool) -> dict[str, Any]:
    rows = found.model.rows
    named = np.array([name == nest for name in rows.nest_name])
    which = found.accepted & named & (rows.on_platform == on_platform)
    which &= rows.in_millimetres.any(axis=0)
    rms, expected = _rms(found, which)
    return {
        "nest": nest,
        "on": "platform" if on_platform else "base",
        "readings": int(which.sum()),
        "rms_um": rms,
        "expected_um": expected,
    }


def _worst(found: Prediction) -> list[dict[str, Any]]:
    rows = found.model.rows
    residual = found.linear.residual
    inverse = np.linalg.pinv(np.moveaxis(found.covariance, -1, 0), hermitian=True)
    squares = np.einsum("in,nij,jn->n", residual, inverse, residual)
    times = np.sqrt(np.maximum(squares / np.maximum(rows.components, 1), 0.0))
    lengths = residual * rows.in_millimetres
    order = [k for k in np.argsort(-times) if found.accepted[k]][:WORST]
    return [
        {
            "run": rows.runs[rows.run[k]].source,
            "line": int(rows.line[k]),
            "pose": rows.pose_name[k],
            "nest": rows.nest_name[k],
            "shift_um": [1000.0 * float(v) for v in _shift(found, k)],
            "distance_um": 1000.0 * float(np.linalg.norm(lengths[:, k])),
            "times_expected": float(times[k]),
        }
        for k in order
    ]


def _shift(found: Prediction, k: int) -> Array:
    """Along the base's axes where a reading says where a point is, else component by component."""
    rows = found.model.rows
    if rows.placed[k]:
        return np.asarray(found.residual_in_base[:, k])
    return np.asarray(found.linear.residual[:, k] * rows.in_millimetres[:, k])


def _bad(found: Prediction, one: Any) -> dict[str, Any]:
    runs = found.model.rows.runs
    said = {"line": one.line, "why": one.why}
    return {**said, "run": runs[one.run].source} if len(runs) > 1 else said


def _frame_words(found: Prediction) -> Sequence[str]:
    """Whether the tracker stands where the model has it."""
    log_p, step = shift_of_frames(found)
    if log_p > math.log(DOUBTFUL):
        return []
    told = [
        f"{length(float(np.linalg.norm(step[:3, k])))} and "
        f"{turn(float(np.linalg.norm(step[3:, k])))}"
        for k in range(step.shape[1])
    ]
    return [
        "These readings would fit better with the tracker elsewhere than the model has it, by "
        f"{', '.join(told)}: if it was moved, --frame fits its place"
    ]


def _advice(rms: float, expected: float, log_p: float, moved: bool) -> str:
    if log_p > math.log(DOUBTFUL):
        return "The run is as near to the model as noise and the model's own uncertainty let it be."
    told = f"The run is {rms / expected:.2f} times as far off as noise and the model's uncertainty"
    if moved:
        return f"{told} explain; see first whether the tracker was moved (--frame)."
    return (
        f"{told} explain: the machine has changed, or an effect is missing. pkmcal diagnose RUN "
        "--model MODEL asks which (and fits again)."
    )
