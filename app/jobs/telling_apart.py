"""What readings can tell apart: rank, groups, gauge freedoms, what another reading would buy."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np

from app.files.machines import closed_machine
from app.files.poses import nest_matrix, read_pose_file
from app.files.site import load_site
from app.jobs.chosen_runs import File
from app.jobs.drawing import CalibratedEntry, Watch, drawn_calibrations
from app.jobs.record import Record, Report
from app.show.drawn_words import calibrated_words
from app.show.identifiability_words import report
from calib.analysis.benefit import options
from calib.analysis.coverage import workspace_poses
from calib.analysis.gauge import gauges
from calib.analysis.identifiability import identifiability as what_is_identified
from calib.analysis.observation import Sights, judge, observe
from calib.analysis.subsets import compare_subsets, matching
from calib.arrays import Array
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.poses.reach import PoseSet, sample_poses
from calib.poses.readings import HAN_2020, DirectionReadings, PoseNoise

POSES, FRESH = 60, 300
NEST_RADIUS = 100.0
"""Radius in mm on which nests are assumed where no site says otherwise."""

Read = Literal["nests", "poses", "positions", "heights"]


@dataclass(frozen=True, kw_only=True)
class RelationEntry(Record):
    """A parameter that looks like others together to every reading: factors by name."""

    name: str
    like: Mapping[str, float]


@dataclass(frozen=True, kw_only=True)
class GaugeMotion(Record):
    """A rigid motion of base or platform: the part of it that readings show, and the verdict."""

    body: str
    motion: str
    visible: float
    verdict: str


@dataclass(frozen=True, kw_only=True)
class GaugeEntry(Record):
    """Rigid motions that are hidden if base frame and nests are both unknown; ``alike`` pairs."""

    exact: int
    weak: int
    motions: tuple[GaugeMotion, ...]
    alike: tuple[tuple[str, ...], ...]


@dataclass(frozen=True, kw_only=True)
class SubsetEntry(Record):
    """What fitting a choice of unknowns leaves at fresh poses, RMS."""

    says: str
    count: int
    rank: int
    priors: bool
    position_um: float
    orientation_mdeg: float


@dataclass(frozen=True, kw_only=True)
class OptionEntry(Record):
    """Another way of measuring, and what it gives at fresh poses, RMS."""

    says: str
    unknowns: int
    rank: int
    parameters: int
    identified: int
    position_um: float
    orientation_mdeg: float


@dataclass(frozen=True, kw_only=True)
class IdentifiabilityReport(Report):
    """What a calibration can tell apart (``pkm-identifiability/1``).

    ``identified`` are parameters whose uncertainty is less than half of their tolerance;
    ``unidentified`` groups are seen only together; ``sigma_ratio`` is the uncertainty over the
    prior's; ``exact_groups`` and ``relations`` cannot be told apart however often they are read.
    ``drawn``: machines of a Monte Carlo, each calibrated; None where none was asked for.
    """

    FORMAT: ClassVar[str] = "pkm-identifiability/1"
    machine: str
    closure: str
    readings: str
    poses: int
    unknowns: int
    rank: int
    weak: int
    smallest_kept: float
    singular_values: tuple[float, ...]
    base_parameters: tuple[str, ...]
    relations: tuple[RelationEntry, ...]
    exact_groups: tuple[tuple[str, ...], ...]
    identified: tuple[str, ...]
    unidentified: tuple[tuple[str, ...], ...]
    sigma_ratio: Mapping[str, float]
    gauge: GaugeEntry
    subsets: tuple[SubsetEntry, ...]
    options: tuple[OptionEntry, ...]
    drawn: CalibratedEntry | None = None
    _text: str = field(repr=False, compare=False)

    @property
    def text(self) -> str:
        """What the verb prints."""
        return self._text


def identifiability(
    machine: str,
    *,
    closure: str = "",
    read: Read = "nests",
    nests: int = 3,
    site: File | None = None,
    sigma_um: float | None = None,
    frame_free: bool = True,
    nests_free: bool = False,
    base_nests: bool = True,
    poses: int | File | None = None,
    only: Sequence[str] = (),
    seed: int = 1,
    monte_carlo: int = 0,
    workers: int | None = None,
    scheduler: str = "",
    watch: Watch | None = None,
) -> IdentifiabilityReport:
    """Tell which parameters readings can tell apart, and what another reading would buy.

    Parameters
    ----------
    machine : str
        Name of a shipped machine, or a machine file.
    closure : str
        Another closure of an over-constrained machine's file.
    read : "nests", "poses", "positions" or "heights"
        What is read at each pose: SMRs in nests, the whole pose, the platform's origin, or the
        nests' heights over the base.
    nests : int
        Nests that are assumed where no ``site`` is named.
    site : path, optional
        A site file: its nests.
    sigma_um : float, optional
        Standard uncertainty of a reading per axis, um; 5 if None.
    frame_free, nests_free : bool
        Whether the base frame and the nests' centres are unknown.
    base_nests : bool
        Whether nests on the base are read.
    poses : int or path, optional
        How many random reachable poses, or a poses file; 60 if None (a pointing machine: every
        10 deg).
    only : sequence of str
        A choice of parameters to judge, with ``?`` and ``*``: ``["limb?.0dx1", "limb5.*"]``.
    seed : int
        Draws the poses, and the machines.
    monte_carlo : int
        So many machines are drawn within their tolerances, read at these poses with noise and
        calibrated: what is left at fresh poses stands in ``drawn``, with how often the predicted
        uncertainties hold.
    workers : int, optional
        Processes that do it; one for each processor if not given.
    scheduler : str
        Address of a Dask scheduler in place of processes.
    watch : callable, optional
        Told how many of how many shares of the machines are done.

    Returns
    -------
    IdentifiabilityReport

    Raises
    ------
    BadInput
        For files that cannot be read, an uncertainty that is not positive, names in ``only`` that
        no parameter has, machines of which none can take all of the poses, and a scheduler that
        does not answer.

    Examples
    --------
    >>> pkmcal.identifiability("tripod", read="heights").unidentified        # doctest: +SKIP
    """
    chosen = closed_machine(machine, closure)
    generator = np.random.default_rng(seed)
    where = _poses(chosen, poses, generator)
    fresh = workspace_poses(chosen, FRESH, generator)
    sights = _sights(read, nests, site, sigma_um, frame_free, nests_free, not base_nests)
    observation = observe(where, sights)
    found = what_is_identified(observation)
    judged = judge(fresh, observation)
    named = matching(_parameters(chosen), list(only)) if only else None
    said, text = report(
        chosen,
        sights.says,
        where.count,
        found,
        gauges(where, NEST_RADIUS),
        compare_subsets(observation, judged, found.base, named),
        options(chosen, where, fresh, sights, generator),
    )
    drawn = None
    if monte_carlo:
        drawn = drawn_calibrations(
            where, fresh, sights, monte_carlo, seed, workers, scheduler, watch
        )
        text += f"\n\n{calibrated_words(drawn)}"
    head = {
        "format": IdentifiabilityReport.FORMAT,
        "machine": chosen.name,
        "closure": closure or "own",
        "drawn": drawn,
    }
    return IdentifiabilityReport.of({**head, **said}, _text=text)


def _poses(machine: Machine, chosen: int | File | None, generator: np.random.Generator) -> PoseSet:
    if chosen is None:
        return workspace_poses(machine, POSES, generator)
    if isinstance(chosen, int):
        return sample_poses(machine, chosen, generator)
    return read_pose_file(Path(chosen), machine).pose_set


def _parameters(machine: Machine) -> list[str]:
    return [p.name for p in machine.parameters]


def _sights(
    read: Read,
    nest_count: int,
    site_file: File | None,
    sigma_um: float | None,
    frame_free: bool,
    nests_free: bool,
    no_base_nests: bool,
) -> Sights:
    sigma = 5.0 if sigma_um is None else sigma_um
    if sigma <= 0.0:
        raise BadInput(f"sigma_um is {sigma:g}", remedy="Give a positive uncertainty.")
    if site_file:
        site = load_site(Path(site_file))
        platform, base = nest_matrix(site.platform_nests), nest_matrix(site.base_nests)
    else:
        platform, base = _circle(nest_count, NEST_RADIUS), _circle(3, 2.6 * NEST_RADIUS)
    base = base[:, :0] if no_base_nests else base
    if read == "nests":
        return Sights(platform, sigma * 1e-3, base, frame_free=frame_free, nests_free=nests_free)
    if read == "heights":
        heights = DirectionReadings(platform, np.array([[0.0], [0.0], [1.0]]), sigma * 1e-3)
        return Sights(np.zeros((3, 0)), sigma * 1e-3, pose_noise=heights)
    whole = HAN_2020 if sigma_um is None else PoseNoise(sigma * 1e-3, HAN_2020.angle_sigma)
    noise = whole if read == "poses" else PoseNoise(whole.position_sigma, None)
    none = np.zeros((3, 0))
    return Sights(none, sigma * 1e-3, base, frame_free=frame_free, pose_noise=noise)


def _circle(count: int, radius: float) -> Array:
    """Nests on a circle about the z axis, (3, count); the first towards y."""
    angle = np.pi / 2.0 + 2.0 * np.pi * np.arange(count) / count
    return radius * np.stack([np.cos(angle), np.sin(angle), np.zeros(count)])
