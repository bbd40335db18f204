"""Compare a fitted model with its runs: where does it fail?"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from app.analysis import load_refitter
from app.files.residuals import residuals_of_fit
from app.files.runs import outside_runs
from app.jobs.chosen_runs import File, Runs, names_of, path_of
from app.jobs.fitting import BadReadingEntry, RemarkEntry
from app.jobs.noise_entries import NoiseEntry
from app.jobs.record import Record, Report
from app.noisy import with_noise_of
from calib.discover.compare import RunComparison, compare_fit
from calib.discover.compare_report import compare_report
from calib.discover.discovery import SEED
from calib.discover.noise_report import noise_report
from calib.discover.terms import propose as propose_terms
from calib.identify import Fit


@dataclass(frozen=True, kw_only=True)
class RepeatabilityEntry(Record):
    """Scatter of repeats, as a multiple of the stated uncertainty, and its part of the misfit."""

    dof: int
    times_stated_sigma: float
    p_value: float
    unrepeatable_part_of_misfit: float


@dataclass(frozen=True, kw_only=True)
class BinEntry(Record):
    """Mean residual over a span of a variable, in the unit of its dependence, 1 sigma."""

    from_: float
    to: float
    readings: int
    value: float | None
    sigma: float | None


@dataclass(frozen=True, kw_only=True)
class DependenceEntry(Record):
    """How the residual depends on one variable; ``unit`` (um or urad) is that of the bins."""

    channel: str
    p_value: float
    significant: bool
    explains_um: float
    shows_in: str
    period: float | None
    unit: str
    bins: tuple[BinEntry, ...]


@dataclass(frozen=True, kw_only=True)
class TogetherEntry(Record):
    """Whether readings of a pose, or neighbours in time, err alike."""

    channel: str
    p_value: float
    significant: bool


@dataclass(frozen=True, kw_only=True)
class ActuatorEntry(Record):
    """RMS residual in one actuator's coordinate, um or urad."""

    actuator: str
    rms: float
    unit: str


@dataclass(frozen=True, kw_only=True)
class WorstPoseEntry(Record):
    """A pose that is off: position in mm and shift in um, base frame."""

    pose: str
    position: tuple[float, ...]
    shift_um: tuple[float, ...]


@dataclass(frozen=True, kw_only=True)
class TermEntry(Record):
    """A formula that would explain what is left.

    ``held_out_um``: RMS over poses that the fit has not seen, with it, and without (``before``);
    ``file`` where it is stable, predicts them better, and was written.
    """

    formula: str
    explains_um: float
    log_evidence: float
    stability: float
    held_out_um: float | None
    held_out_before_um: float | None
    file: str | None


@dataclass(frozen=True, kw_only=True)
class CompareReport(Report):
    """Model against readings (``pkm-compare/1``); p-values pay for having looked at everything.

    ``noise``: what they count with, that of the model file where it has some.
    """

    FORMAT: ClassVar[str] = "pkm-compare/1"
    effects: tuple[str, ...]
    readings: int
    rms_um: float | None
    noise_floor_um: float | None
    chi2_per_dof: float | None
    repeatability: RepeatabilityEntry | None
    reference_repeatability: RepeatabilityEntry | None
    structure: tuple[DependenceEntry, ...]
    together: tuple[TogetherEntry, ...]
    actuators: tuple[ActuatorEntry, ...]
    worst_poses: tuple[WorstPoseEntry, ...]
    bad_readings: tuple[BadReadingEntry, ...]
    record: tuple[RemarkEntry, ...]
    advice: str
    noise: NoiseEntry
    proposed: tuple[TermEntry, ...] = ()
    _found: RunComparison = field(repr=False, compare=False)
    _runs: tuple[str, ...] = field(repr=False, compare=False)

    def draw(self, folder: File) -> list[Path]:
        """Draw structure, workspace and actuators into a folder; returns the figures' files.

        Raises
        ------
        BadInput
            If the folder lies in a run's.
        """
        from app.show.compare_charts import write_charts

        path = Path(folder)
        outside_runs(path, self._runs)
        return write_charts(self._found, path)

    def residuals(self, file: File) -> None:
        """Write measured minus predicted of every reading as CSV, those left out as well.

        Raises
        ------
        BadInput
            If the file would lie in a run's folder.
        """
        residuals_of_fit(Path(file), self._found.fit, self._runs)


def compare(
    runs: Runs,
    *,
    add: Sequence[str] = (),
    model: File | None = None,
    propose: File | None = None,
    watch: Callable[[tuple[str, ...]], None] | None = None,
) -> CompareReport:
    """Compare the fitted model with the readings: on what does the residual depend?

    Parameters
    ----------
    runs, add, model
        As for :func:`fit`.
    propose : path, optional
        Look for terms that would explain what is left, and write those that are stable and predict
        unseen poses better as effect files (FILE, FILE-2 ...), which ``add`` takes.
    watch : callable, optional
        Told the effects of each model that is fitted.

    Returns
    -------
    CompareReport
        ``structure`` has the variable with the most structure first.

    Raises
    ------
    BadInput
        Naming the file and the place in it.

    Examples
    --------
    >>> seen = pkmcal.compare("run")                                         # doctest: +SKIP
    >>> [one.channel for one in seen.structure if one.significant]           # doctest: +SKIP
    ['q3', 'direction']
    """
    names, file = names_of(runs), path_of(propose)
    outside_runs(file, names)
    refit, begin = load_refitter(names, tuple(add), path_of(model), watch)
    plain = refit.fit(begin)
    found = compare_fit(with_noise_of(plain, path_of(model)), np.random.default_rng(SEED))
    said = {**compare_report(found), "noise": noise_report(found.fit)}
    if file is not None:
        said["proposed"] = _propose(plain, file)
    return CompareReport.of(said, _found=found, _runs=names)


def _in_um(rms_mm: float) -> float | None:
    return 1000.0 * rms_mm if np.isfinite(rms_mm) else None


def _propose(fitted: Fit, path: Path) -> list[dict[str, Any]]:
    """Write every stable term: FILE, FILE-2 ...; what was found, stable or not."""
    listed: list[dict[str, Any]] = []
    stable = 0
    for term in propose_terms(fitted, np.random.default_rng(SEED)):
        file = None
        if term.good:
            stable += 1
            name = path.name if stable == 1 else f"{path.stem}-{stable}{path.suffix}"
            file = path.with_name(name)
            file.write_text(term.text, encoding="utf-8")
        listed.append(
            {
                "formula": term.formula,
                "explains_um": 1000.0 * term.explains_mm,
                "log_evidence": term.selected.log_evidence,
                "stability": term.selected.frequency,
                "held_out_um": _in_um(term.held_out_mm[1]),
                "held_out_before_um": _in_um(term.held_out_mm[0]),
                "file": None if file is None else str(file),
            }
        )
    return listed
