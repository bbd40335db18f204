"""Fit a model to runs."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from app.analysis import load_rows, masked_rows
from app.files.models import write_model
from app.files.residuals import residuals_of_fit
from app.files.runs import outside_runs
from app.files.staircase import Way
from app.jobs.chosen_runs import File, Runs, lines_of, names_of, path_of
from app.jobs.noise_entries import NoiseEntry
from app.jobs.record import Record, Report
from app.jobs.remembering import remember_fit
from app.noisy import noisy
from calib.discover.agreement import (
    log_chance,
    more_than_noise,
    runs_at_odds,
    successive_alike,
)
from calib.discover.cables import slack_cables
from calib.discover.noise_report import noise_report
from calib.identify import Fit, fit_report
from calib.identify.beyond import beyond_words
from calib.identify.staged import fit_effects
from calib.look.judged import record_of
from calib.runs.remark import plain_remarks


@dataclass(frozen=True, kw_only=True)
class BadReadingEntry(Record):
    """A reading that is left out: line of ``points.csv`` (and the run, where there are several)."""

    line: int
    why: str
    run: str = ""


@dataclass(frozen=True, kw_only=True)
class RemarkEntry(Record):
    """A hypothesis about the record itself, said before any physics.

    ``lines`` of ``points.csv`` as (first, last); ``done`` about it for the analysis, ``remedy`` in
    the files. Where it is not ``settled``, no model is called adequate.
    """

    name: str
    says: str
    lines: tuple[tuple[int, ...], ...]
    evidence: str
    done: str
    remedy: str
    settled: bool
    run: str = ""


@dataclass(frozen=True, kw_only=True)
class ParameterEntry(Record):
    """A parameter as it was found; mm, rad or what ``unit`` says, ``sigma`` 1 standard deviation.

    ``nominal`` is None for the place of the tracker; ``identified``: the readings reduce the
    tolerance to less than half. ``means``: what a number stands for that is one of a few, or a
    moment of several runs.
    """

    name: str
    value: float
    sigma: float
    unit: str
    nominal: float | None
    identified: bool
    means: str = ""


@dataclass(frozen=True, kw_only=True)
class KindEntry(Record):
    """How well the readings of one kind are explained; ``unit`` is um or urad.

    ``rms`` and ``floor`` (what a perfect model would show) are per component, over those that are
    not a hundred times vaguer than the best; ``ratio`` is over all, each by its own sigma: 1 is
    perfect.
    """

    kind: str
    readings: int
    components: int
    unit: str
    rms: float | None
    floor: float | None
    ratio: float | None


@dataclass(frozen=True, kw_only=True)
class FitReport(Report):
    """What a fit found (``pkm-fit/1``).

    Errors are RMS of the 3D distance between measured and predicted SMR centre in micrometres;
    a ``floor`` is what a perfect model would show; ``holdout`` is over poses that were not fitted,
    ``platform`` over the same readings as they were fitted. ``by_kind`` has each kind of reading.
    ``p_value``: how often noise alone leaves a chi-square as large; from 0.01 down a remark says
    that something is missing. ``noise`` is what uncertainties and floors count with: that of the
    model file, else what the readings demand where nothing but noise is off. Where it is not
    ``settled`` the answer is the best point that its ``steps`` came to.
    """

    FORMAT: ClassVar[str] = "pkm-fit/1"
    effects: tuple[str, ...]
    readings: int
    chi2_per_dof: float | None
    log10_p: float | None
    p_value: float | None
    rms_um: float | None
    noise_floor_um: float | None
    holdout_rms_um: float | None
    holdout_floor_um: float | None
    platform_rms_um: float | None
    platform_floor_um: float | None
    by_kind: tuple[KindEntry, ...]
    parameters: tuple[ParameterEntry, ...]
    unidentified: tuple[tuple[str, ...], ...]
    unidentified_words: tuple[str, ...]
    bad_readings: tuple[BadReadingEntry, ...]
    left_out_readings: int
    channels_left_aside: Mapping[str, str]
    settled: bool
    steps: int
    remarks: tuple[str, ...]
    record: tuple[RemarkEntry, ...]
    noise: NoiseEntry
    _fit: Fit = field(repr=False, compare=False)
    _runs: tuple[str, ...] = field(repr=False, compare=False)

    def __getitem__(self, name: str) -> ParameterEntry:
        """The parameter of that name; raises KeyError."""
        for parameter in self.parameters:
            if parameter.name == name:
                return parameter
        raise KeyError(name)

    def save(self, file: File) -> None:
        """Write a model file, correlations included: for ``model=`` and for writing back.

        Raises
        ------
        BadInput
            If the file would lie in a run's folder, or the runs were taken under different
            compensation.
        """
        keep_model(file, self._fit, self._runs)

    def residuals(self, file: File) -> None:
        """Write measured minus predicted of every reading as CSV, those left out as well.

        Raises
        ------
        BadInput
            If the file would lie in a run's folder.
        """
        residuals_of_fit(Path(file), self._fit, self._runs)


def fit(
    runs: Runs,
    *,
    add: Sequence[str] = (),
    model: File | None = None,
    mask: Sequence[int | str] = (),
) -> FitReport:
    """Fit geometry, the tracker's place and the chosen effects to one or several runs.

    Parameters
    ----------
    runs : path or sequence of paths
        Run folders; several are fitted together and share geometry and machine effects.
    add : sequence of str
        Effects in the model: names, or effect files that end in ``.toml``.
    model : path, optional
        A saved model to begin with.
    mask : sequence of int or str, optional
        Lines of ``points.csv`` that are left out, and said in ``bad_readings``; of several runs
        ``"run:118"``.

    Returns
    -------
    FitReport
        ``found["leg1.L0"]`` is one parameter.

    Raises
    ------
    BadInput
        Naming the file and the place in it.

    Examples
    --------
    >>> found = pkmcal.fit("run", add=["backlash"])                          # doctest: +SKIP
    >>> found.rms_um, found["backlash.leg3"].value                           # doctest: +SKIP
    (8.9, 0.0152)
    """
    names = names_of(runs)
    rows, effects = load_rows(names, tuple(add), path_of(model))
    found = noisy(fit_effects(rows, effects, masked_rows(rows, lines_of(mask))), path_of(model))
    remember_fit(found, names)
    return FitReport.of(said_of_fit(found), _fit=found, _runs=names)


def said_of_fit(found: Fit) -> dict[str, Any]:
    """What there is to say of a fit, as :class:`FitReport` has it."""
    noise = noise_report(found)
    words = (
        f"As to noise: {noise['words']}" if noise["words"] else "",
        runs_at_odds(found), successive_alike(found), more_than_noise(found), slack_cables(found),
        *beyond_words(found),
    )  # fmt: skip
    log_p = log_chance(found)
    return {
        **fit_report(found),
        "log10_p": None if log_p is None else log_p / math.log(10.0),
        "p_value": None if log_p is None else math.exp(log_p),
        "settled": found.settled,
        "steps": found.steps,
        "remarks": [f"{one}." for one in words if one],
        "record": plain_remarks(record_of(found)),
        "noise": noise,
    }


def keep_model(file: File, found: Fit, runs: tuple[str, ...], way: Way | None = None) -> None:
    """Write a model file beside the runs, never into one."""
    path = path_of(file)
    assert path is not None
    outside_runs(path, runs)
    write_model(path, found, way or Way())
