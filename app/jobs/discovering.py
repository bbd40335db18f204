"""Ask what the model misses: once (diagnose), or until nothing is missing (discover)."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

from app.analysis import asked_for, load_refitter
from app.files.residuals import residuals_of_fit
from app.files.staircase import way_of_discovery
from app.jobs.chosen_runs import File, Runs, lines_of, names_of, path_of, paths_of
from app.jobs.fitting import BadReadingEntry, RemarkEntry, keep_model
from app.jobs.noise_entries import NoiseEntry
from app.jobs.record import Record, Report
from app.jobs.remembering import remember_fit
from calib.discover.discovery import discover_run, stage_of
from calib.discover.report import diagnosis_report, discovery_report
from calib.evidence.forward import Discovery
from calib.identify import Fit

Watch = Callable[[tuple[str, ...]], None]
"""Told the effects of each model that is looked at."""


@dataclass(frozen=True, kw_only=True)
class SizeEntry(Record):
    """An effect's parameter: mm, rad, K, N or what ``unit`` says; sigma 1 standard deviation."""

    name: str
    value: float
    sigma: float
    unit: str
    means: str = ""


@dataclass(frozen=True, kw_only=True)
class BaselineEntry(Record):
    """The model that is asked, and how well it does; errors as in :class:`FitReport`."""

    effects: tuple[str, ...]
    chi2_per_dof: float | None
    rms_um: float | None
    noise_floor_um: float | None
    holdout_rms_um: float | None
    holdout_floor_um: float | None


@dataclass(frozen=True, kw_only=True)
class CandidateEntry(Record):
    """An effect that may be missing.

    ``p_value`` pays for having looked at all of them; ``visible`` is the part of its signature
    that no other unknown can take over, 0 to 1.
    """

    effect: str
    p_value: float
    rms_after_um: float | None
    holdout_rms_after_um: float | None
    visible: float
    parameters: tuple[SizeEntry, ...]


@dataclass(frozen=True, kw_only=True)
class CarrierEntry(Record):
    """What depends on a column: ``moves`` is legs, one leg, or every point read.

    ``amplitude`` (``unit``) of a wave; ``direction`` in the tracker frame, where it goes one way.
    """

    channel: str
    moves: str
    period: float | None
    amplitude: float | None
    unit: str
    direction: tuple[float, ...] | None
    log_evidence: float


@dataclass(frozen=True, kw_only=True)
class UnexplainedEntry(Record):
    """What no known effect explains, and on which columns it depends, strongest first.

    ``p_value`` is that of the strongest structure there is, significant or not.
    """

    significant: bool
    channels: tuple[str, ...]
    periods: Mapping[str, float] = field(default_factory=dict)
    carriers: tuple[CarrierEntry, ...] = ()
    p_value: float = 1.0


@dataclass(frozen=True, kw_only=True)
class LikenessEntry(Record):
    """Which known effects the unknown is like, and how much: 1 is all of it, 0 nothing."""

    effects: tuple[str, ...]
    value: float


@dataclass(frozen=True, kw_only=True)
class HintEntry(Record):
    """An effect that may be there besides: chance looks like this in some runs of a hundred."""

    effect: str
    p_value: float


@dataclass(frozen=True, kw_only=True)
class ImpossibleEntry(Record):
    """An effect called for weakly that was refused, as physics forbids its ``value``.

    ``otherwise``: which mistake in the files would make that sign, if it is not chance.
    """

    effect: str
    p_value: float
    value: str
    otherwise: str


@dataclass(frozen=True, kw_only=True)
class DiagnosisReport(Report):
    """What is missing from a model (``pkm-diagnosis/1``); the best candidate first."""

    FORMAT: ClassVar[str] = "pkm-diagnosis/1"
    baseline: BaselineEntry
    adequate: bool
    record: tuple[RemarkEntry, ...]
    candidates: tuple[CandidateEntry, ...]
    indistinguishable: tuple[tuple[str, ...], ...]
    unexplained: UnexplainedEntry
    likeness: LikenessEntry | None = None
    hints: tuple[HintEntry, ...] = ()
    noise: NoiseEntry
    bad_readings: tuple[BadReadingEntry, ...]
    unavailable: Mapping[str, str]
    not_on_this_machine: Mapping[str, str]
    advice: str
    _fit: Fit = field(repr=False, compare=False)
    _runs: tuple[str, ...] = field(repr=False, compare=False)

    def residuals(self, file: File) -> None:
        """Write measured minus predicted of every reading as CSV, those left out as well.

        Raises
        ------
        BadInput
            If the file would lie in a run's folder.
        """
        residuals_of_fit(Path(file), self._fit, self._runs)


@dataclass(frozen=True, kw_only=True)
class StepEntry(Record):
    """A model on the way; None as ``added`` is the one to begin with.

    ``p_value`` (family-wise), ``log_evidence`` (log Bayes factor against nothing) and ``rivals``
    (effects that this run cannot tell from it) are those of the effect when it was added; ``weak``:
    such a p-value may well be chance. What the record itself shows (``record``) has none of them.
    """

    added: str | None
    removed: str | None = None
    p_value: float | None = None
    log_evidence: float | None = None
    weak: bool = False
    rivals: tuple[str, ...] = ()
    chi2_per_dof: float | None
    rms_um: float | None
    noise_floor_um: float | None
    holdout_rms_um: float | None
    holdout_floor_um: float | None


@dataclass(frozen=True, kw_only=True)
class DiscoveryReport(Report):
    """What was found step by step (``pkm-discovery/1``); errors as in :class:`FitReport`."""

    FORMAT: ClassVar[str] = "pkm-discovery/1"
    steps: tuple[StepEntry, ...]
    effects: tuple[str, ...]
    adequate: bool
    record: tuple[RemarkEntry, ...]
    indistinguishable: tuple[tuple[str, ...], ...]
    unexplained: UnexplainedEntry
    likeness: LikenessEntry | None = None
    hints: tuple[HintEntry, ...] = ()
    noise: NoiseEntry
    bad_readings: tuple[BadReadingEntry, ...]
    unavailable: Mapping[str, str]
    parameters: tuple[SizeEntry, ...]
    refused: tuple[str, ...]
    impossible: tuple[ImpossibleEntry, ...] = ()
    not_on_this_machine: Mapping[str, str] = field(default_factory=dict)
    advice: str
    _found: Discovery = field(repr=False, compare=False)
    _runs: tuple[str, ...] = field(repr=False, compare=False)

    @property
    def fitted(self) -> Fit:
        """The fit of the model in the end."""
        return stage_of(self._found).run.fit

    def save(self, file: File) -> None:
        """Write a model file with what was found, as :meth:`FitReport.save`."""
        way = way_of_discovery(self.to_json())
        keep_model(file, self.fitted, self._runs, way)

    def residuals(self, file: File) -> None:
        """Write measured minus predicted of every reading as CSV, those left out as well.

        Raises
        ------
        BadInput
            If the file would lie in a run's folder.
        """
        residuals_of_fit(Path(file), self.fitted, self._runs)


def diagnose(
    runs: Runs,
    *,
    add: Sequence[str] = (),
    model: File | None = None,
    offer: Sequence[File] = (),
    mask: Sequence[int | str] = (),
    each_run: bool = False,
    watch: Watch | None = None,
) -> DiagnosisReport:
    """Score every known effect against what the fit leaves: which one is missing?

    Parameters
    ----------
    runs, add, model
        As for :func:`fit`.
    offer : sequence of paths, optional
        Effect files (docs/own-effects.md) that are candidates beside the catalogue.
    mask : sequence of int or str, optional
        As for :func:`fit`.
    each_run : bool
        Of several runs: ask of every machine effect as well whether one run alone has it.
    watch : callable, optional
        Told the effects of each model that is fitted.

    Returns
    -------
    DiagnosisReport

    Raises
    ------
    BadInput
        Naming the file and the place in it.

    Examples
    --------
    >>> asked = pkmcal.diagnose("run")                                       # doctest: +SKIP
    >>> asked.adequate, asked.candidates[0].effect                           # doctest: +SKIP
    (False, 'backlash')
    """
    names = names_of(runs)
    refit, begin = load_refitter(
        names, tuple(add), path_of(model), watch, paths_of(offer), lines_of(mask), each_run
    )
    found = refit(begin).run
    return DiagnosisReport.of(diagnosis_report(found), _fit=found.fit, _runs=names)


def discover(
    runs: Runs,
    *,
    add: Sequence[str] = (),
    model: File | None = None,
    offer: Sequence[File] = (),
    mask: Sequence[int | str] = (),
    each_run: bool = False,
    watch: Watch | None = None,
) -> DiscoveryReport:
    """Add the best effect, fit again, and go on until nothing more is called for.

    An effect is accepted only if poses that the fit has not seen are predicted no worse with it.

    Parameters
    ----------
    runs, add, model
        As for :func:`fit`; these effects stay in.
    offer : sequence of paths, optional
        Effect files that are candidates beside the catalogue.
    mask : sequence of int or str, optional
        As for :func:`fit`.
    each_run : bool
        Of several runs: ask of every machine effect as well whether one run alone has it.
    watch : callable, optional
        Told the effects of each model that is looked at.

    Returns
    -------
    DiscoveryReport

    Raises
    ------
    BadInput
        Naming the file and the place in it.

    Examples
    --------
    >>> found = pkmcal.discover("run")                                       # doctest: +SKIP
    >>> found.effects, found.adequate                                        # doctest: +SKIP
    (('backlash',), True)
    >>> found.save("model.toml")                                             # doctest: +SKIP
    """
    names = names_of(runs)
    refit, begin = load_refitter(
        names, tuple(add), path_of(model), watch, paths_of(offer), lines_of(mask), each_run
    )
    found = discover_run(refit, asked_for(refit, begin, add))
    remember_fit(stage_of(found).run.fit, names)
    return DiscoveryReport.of(discovery_report(found), _found=found, _runs=names)
