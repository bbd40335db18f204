"""Choose where to measure, and predict what accuracy that gives."""

import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, ClassVar, Literal, Self

import numpy as np

from app.files.pose_table import Pose, poses_text
from app.files.poses import full_poses, render_design
from app.files.site import Site
from app.files.site_limits import Limits
from app.jobs.chosen_runs import File, at_least
from app.jobs.foreseeing import RESERVED, explored, read_by_tracker
from app.jobs.read_there import CALIPERS_SIGMA_UM, readings_of
from app.jobs.record import Record, Report
from app.jobs.searching import Search, best_of, fresh_poses, search
from app.jobs.verification_grid import machine_for, site_of
from calib.defaults import POSES_FROM
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.mechanism.limits import Margin
from calib.poses.design import Design
from calib.poses.gauges import MarkPairs, choose_marks
from calib.poses.information import Accuracy
from calib.poses.margin import stroke_margin


@dataclass(frozen=True, kw_only=True)
class PoseEntry(Record):
    """A pose: its label, the machine's task coordinates (mm, rad) and the actuators' (mm, rad)."""

    FLAT: ClassVar[str] = "coordinates"
    label: str
    q: tuple[float, ...]
    coordinates: Mapping[str, float]

    @classmethod
    def of(cls, table: Mapping[str, Any], **beside: Any) -> Self:
        """Read a pose; every key but label and q is a coordinate."""
        rest = {key: float(value) for key, value in table.items() if key not in ("label", "q")}
        return super().of({"label": table["label"], "q": table["q"], "coordinates": rest})


@dataclass(frozen=True, kw_only=True)
class AccuracyEntry(Record):
    """RMS error at fresh poses, position in um and orientation in mdeg."""

    position_rms_um: float
    orientation_rms_mdeg: float | None


@dataclass(frozen=True, kw_only=True)
class CountEntry(AccuracyEntry):
    """The same for ``n`` poses."""

    n: int


@dataclass(frozen=True, kw_only=True)
class KeptFreeEntry(Record):
    """What is kept free at each end of an actuator's range, in its unit (mm or rad)."""

    actuator: str
    each_end: float
    unit: str


@dataclass(frozen=True, kw_only=True)
class SightEntry(Record):
    """An effect of size 1 (it moves the readings by sqrt(3) sigma): probability to see it.

    ``by_accuracy`` with as many poses chosen for accuracy alone; ``why``: where it is hardly seen,
    and what the poses lack.
    """

    effect: str
    power: float
    by_accuracy: float
    why: str


@dataclass(frozen=True, kw_only=True)
class PosesReport(Report):
    """Chosen poses in the order of a short path, and what they will give (``pkm-design/1``).

    ``purpose``: accuracy, or discovery: some of the poses then show what the machine may hide,
    ``will_see`` tells what, the least first, and ``not_asked`` why effects are not in it.
    ``pairs``: marks between which calipers tell most (``p01:p07``), ``with_pairs``: with them
    measured as well. ``kept_free``: what a machine within tolerance needs at the ends of its
    actuators' ranges.
    """

    FORMAT: ClassVar[str] = "pkm-design/1"
    machine: str
    criterion: str
    readings: str
    tolerances_as_priors: bool
    candidates: int
    seed: int
    purpose: str = "accuracy"
    predicted: AccuracyEntry
    random_poses: AccuracyEntry
    by_count: tuple[CountEntry, ...]
    path_in_strokes: float
    pairs: tuple[str, ...] = ()
    with_pairs: AccuracyEntry | None = None
    kept_free: tuple[KeptFreeEntry, ...]
    will_see: tuple[SightEntry, ...] = ()
    not_asked: Mapping[str, str] = field(default_factory=dict)
    poses: tuple[PoseEntry, ...]
    _design: Design = field(repr=False, compare=False)
    _command: str = field(repr=False, compare=False)

    def by_label(self) -> dict[str, Pose]:
        """Label -> x, y, z (mm), rx, ry, rz (rad): the platform in the base frame, in order."""
        return full_poses(self._design.labels, self._design.pose_set)

    def save(self, file: File) -> None:
        """Write a poses file for measuring; a bare table where its name ends in ``.csv``."""
        path = Path(file)
        bare = path.suffix == ".csv"
        text = (
            poses_text(self.by_label())
            if bare
            else render_design(self._design, self.seed, self._command, self.pairs)
        )
        path.write_text(text, encoding="utf-8")


def choose_poses(
    machine: str | os.PathLike[str] | None = None,
    n: int = 29,
    *,
    site: File | Site | None = None,
    criterion: Literal["I", "D"] = "I",
    priors: bool = True,
    heights: bool = False,
    calipers: int = 0,
    calipers_um: float = CALIPERS_SIGMA_UM,
    sigma_um: float | None = None,
    angle_mdeg: float | None = None,
    candidates: int = POSES_FROM,
    seed: int = 1,
    margin_mm: float | None = None,
    searches: int = 1,
    workers: int | None = None,
    scheduler: str = "",
    watch: Callable[[int, int], None] | None = None,
    purpose: Literal["accuracy", "discovery"] = "accuracy",
) -> PosesReport:
    """Choose measurement poses among reachable ones, and predict what accuracy they give.

    Parameters
    ----------
    machine : str or path, optional
        A shipped machine's name, or a machine file; that of the site if missing.
    n : int
        How many poses.
    site : path or Site, optional
        A site file, or what was read of one: its nests are read. Without, whole poses are, with
        the noise of Han et al. 2020.
    criterion : "I" or "D"
        Smallest predicted pose error, or most information about the parameters.
    priors : bool
        Use the machine file's tolerances as priors.
    heights : bool
        Only heights over the base are read: of the site's nests, or of the platform's origin.
    calipers : int
        So many pairs of marks are chosen as well, left by the first nest (the platform's origin
        without a site), to be measured with calipers.
    calipers_um : float
        Standard uncertainty of such a distance, um.
    sigma_um, angle_mdeg : float, optional
        Standard uncertainty of a reading per axis, um, and of an angle, mdeg, where whole poses
        are read.
    candidates : int
        Reachable poses among which is chosen.
    seed : int
        Draws the candidates.
    margin_mm : float, optional
        Kept free at the ends of strokes beyond what the tolerances need; the site's if missing.
    searches : int
        So many searches, from ``seed`` on each with the next; the one with the smallest predicted
        error is kept, and its ``seed`` told.
    workers : int, optional
        Processes that do them; one for each processor if not given.
    scheduler : str
        Address of a Dask scheduler in place of processes.
    watch : callable, optional
        Told how many of how many searches are done.
    purpose : "accuracy" or "discovery"
        All for accuracy; or a third of them to show what the machine may hide, read by a tracker,
        with a table of what they will see.

    Returns
    -------
    PosesReport

    Raises
    ------
    BadInput
        For a machine or site that cannot be read, uncertainties that are not positive, and a
        scheduler that does not answer.

    Examples
    --------
    >>> chosen = pkmcal.choose_poses("hexapod", 29)                          # doctest: +SKIP
    >>> chosen.predicted.position_rms_um                                     # doctest: +SKIP
    6.7
    >>> chosen.save("poses.toml")                                            # doctest: +SKIP
    """
    at_least(1, n=n, candidates=candidates, searches=searches)
    named = "" if machine is None else os.fspath(machine)
    here = site_of(site)
    described = machine_for(named, here)
    margin = _margin(described, here, margin_mm)
    to_see = purpose == "discovery"
    if to_see:
        at_least(RESERVED, n=n)
    read = read_by_tracker if to_see else readings_of
    readings = read(described, here, heights, sigma_um, angle_mdeg)
    asked = Search(described, here, readings, n, seed, criterion, priors, candidates, margin)
    if searches > 1:
        asked = replace(asked, fresh=fresh_poses(described, seed))
        several = [replace(asked, seed=seed + number) for number in range(searches)]
        found, seed = best_of(several, workers, scheduler, watch)
    else:
        found = search(asked)
    sights: dict[str, Any] = {"purpose": purpose, "will_see": [], "not_asked": {}}
    if to_see:
        own = search(replace(asked, count=n - n // RESERVED, seed=seed))
        rng = np.random.default_rng([seed, 1])
        found, sights = explored(found, own, readings, here, rng, margin)
    marks = None
    if calipers:
        nest = next(iter(here.platform_nests.values())) if here else (0.0, 0.0, 0.0)
        marks = choose_marks(found, readings, calipers, np.array(nest), calipers_um * 1e-3)
    # What brings the same poses again stands in the file.
    command = (
        f"pkmcal poses {named or described.name} --n {n} "
        f"--criterion {criterion} --seed {seed} --candidates {candidates}"
    )
    command += " --for discovery" if to_see else ""
    command += "" if priors else " --no-priors"
    command += f" --site {here.source}" if here else ""
    command += " --heights" if heights else ""
    command += f" --calipers {calipers} --calipers-um {calipers_um:g}" if calipers else ""
    command += f" --sigma-um {sigma_um:g}" if sigma_um is not None else ""
    command += f" --angle-mdeg {angle_mdeg:g}" if angle_mdeg is not None else ""
    command += f" --margin-mm {margin_mm:g}" if margin_mm is not None else ""
    said = _said(found, seed, margin, marks) | sights
    return PosesReport.of(said, _design=found, _command=command)


def _margin(machine: Machine, site: Site | None, margin_mm: float | None) -> Margin:
    """What tolerances need, and at strokes what effects add to it where the host compensates."""
    if margin_mm is None:
        margin_mm = (site.limits if site else Limits()).margin_mm
    if margin_mm < 0.0:
        raise BadInput(f"--margin-mm is {margin_mm:g}", remedy="Give 0 or more.")
    return stroke_margin(machine, margin_mm)


def _accuracy(accuracy: Accuracy) -> dict[str, float]:
    return {
        "position_rms_um": accuracy.position_um,
        "orientation_rms_mdeg": accuracy.orientation_mdeg,
    }


def _said(design: Design, seed: int, margin: Margin, marks: MarkPairs | None) -> dict[str, Any]:
    """A choice of poses as plain data."""
    names = design.machine.task.coordinates
    return {
        "format": "pkm-design/1",
        "machine": design.machine.name,
        "criterion": design.criterion,
        "readings": design.readings,
        "tolerances_as_priors": design.priors,
        "candidates": design.candidates,
        "seed": seed,
        "predicted": _accuracy(design.accuracy),
        "random_poses": _accuracy(design.random),
        "by_count": [{"n": n, **_accuracy(a)} for n, a in design.by_count],
        "path_in_strokes": design.length,
        "pairs": [] if marks is None else [":".join(pair) for pair in marks.pairs],
        "with_pairs": None
        if marks is None
        else {
            "position_rms_um": marks.position_um,
            "orientation_rms_mdeg": marks.orientation_mdeg,
        },
        "kept_free": [
            {"actuator": actuator.name, "each_end": kept, "unit": actuator.unit}
            for actuator, kept in zip(design.machine.actuators, margin.actuators, strict=True)
        ],
        "poses": [
            {"label": label, **dict(zip(names, task, strict=True)), "q": q}
            for label, task, q in zip(
                design.labels, design.pose_set.task.T, design.pose_set.q.T, strict=True
            )
        ],
    }
