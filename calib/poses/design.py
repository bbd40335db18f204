"""Design of a measuring campaign: which poses, in which order, and what they will give."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array
from calib.defaults import POSES_FROM
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.mechanism.limits import Margin
from calib.poses.choose import Candidates, Criterion, exchange, greedy
from calib.poses.information import Accuracy, Judge, covariance, prior, whitened_rows
from calib.poses.path import check_path, path_length, short_order
from calib.poses.reach import PoseSet, joined_poses, sample_poses
from calib.poses.readings import Readings

FRESH = 1000
"""Reachable poses, drawn apart from the candidates, on which the prediction is judged."""
LEVER = 50.0
"""Distance in mm at which an orientation error counts as a position error."""
ROUNDS = 60
"""Poses tried for exchange; two sweeps over 29 poses."""
TABLE_ROUNDS = 3
"""Poses tried for exchange at each number of poses of the table."""
TABLE = tuple(range(10, 61))


@dataclass(frozen=True, eq=False)
class Design:
    """Chosen measurement poses, in the order of a short path, and what is predicted for them.

    Attributes
    ----------
    pose_set : PoseSet
        In the order of the path.
    labels : tuple of str
        ``p01`` ..
    criterion : "I" or "D"
    readings : str
        What is read at each pose, in words.
    priors : bool
        Whether the machine file's tolerances are used.
    candidates : int
        Reachable poses among which was chosen.
    accuracy, random : Accuracy
        Predicted over fresh reachable poses, for these poses and for as many random ones.
    by_count : tuple of (n, Accuracy)
        Predicted for other numbers of poses.
    length : float
        Length of the path in strokes of the slowest actuator.
    """

    pose_set: PoseSet
    labels: tuple[str, ...]
    criterion: Criterion
    readings: str
    priors: bool
    candidates: int
    accuracy: Accuracy
    random: Accuracy
    by_count: tuple[tuple[int, Accuracy], ...]
    length: float

    @property
    def machine(self) -> Machine:
        """The machine for which the poses are."""
        return self.pose_set.machine


def labels_for(count: int) -> tuple[str, ...]:
    """``p01`` .. as many digits as it takes."""
    width = max(2, len(str(count)))
    return tuple(f"p{i:0{width}d}" for i in range(1, count + 1))


def choose_poses(
    rows: Array,
    base: Array,
    judge: Judge,
    count: int,
    *,
    criterion: Criterion,
    priors: bool,
    rounds: int = ROUNDS,
) -> Candidates:
    """Choose ``count`` of the candidates with rows (p, m, N): greedy plus exchange."""
    candidates = Candidates(rows, base, judge.weight(LEVER), criterion)
    greedy(candidates, count, spread_first=not priors)
    exchange(candidates, rounds)
    candidates.refresh()
    return candidates


def accuracy_by_count(
    rows: Array,
    base: Array,
    judge: Judge,
    fresh: Judge,
    counts: Sequence[int],
    *,
    criterion: Criterion,
    priors: bool,
) -> list[tuple[int, Accuracy]]:
    """Predicted accuracy for growing numbers of poses: one greedy way with a few exchanges."""
    candidates = Candidates(rows, base, judge.weight(LEVER), criterion)
    table = []
    for count in sorted(counts):
        greedy(candidates, count, spread_first=not priors)
        exchange(candidates, TABLE_ROUNDS)
        table.append((count, fresh.accuracy(candidates.C)))
    return table


def design_poses(
    machine: Machine,
    readings: Readings,
    count: int,
    generator: np.random.Generator,
    *,
    criterion: Criterion = "I",
    priors: bool = True,
    candidates: int = POSES_FROM,
    counts: Sequence[int] = TABLE,
    margin: Margin | None = None,
    draw: Callable[[int, np.random.Generator], PoseSet] | None = None,
) -> Design:
    """Choose measurement poses.

    Parameters
    ----------
    machine : Machine
    readings : Readings
        What is read at each pose.
    count : int
        How many poses are wanted.
    generator : numpy Generator
    criterion : "I" or "D"
        Smallest predicted pose error over the workspace, or largest determinant of the
        information about the parameters.
    priors : bool
        Use the machine file's tolerances as priors.
    candidates : int
        Reachable poses among which to choose.
    counts : sequence of int
        Numbers of poses for the table; empty for none.
    margin : Margin, optional
        Kept free of all limits by the poses and on the way between them.
    draw : function, optional
        Draws so many candidates where not every reachable pose is one.

    Raises
    ------
    BadInput
        If there are too few candidates, hardly any pose is reachable, or the way between the
        poses leaves the limits.
    """
    most = max([count, *counts])
    if count < 1 or candidates < most:
        raise BadInput(
            f"{count} poses of {candidates} candidates", remedy="Ask for fewer poses, at least one."
        )
    pool = (
        sample_poses(machine, candidates, generator, margin)
        if draw is None
        else draw(candidates, generator)
    )
    fresh_poses = sample_poses(machine, FRESH, generator)
    known = prior(pool, readings, priors=priors)
    rows = whitened_rows(pool, readings, known.scale)
    judge = Judge.over(pool, readings, known.scale)
    fresh = Judge.over(fresh_poses, readings, known.scale)
    chosen = choose_poses(rows, known.information, judge, count, criterion=criterion, priors=priors)
    random = Candidates(rows, known.information, judge.weight(LEVER), "D")
    random.chosen = list(range(count))
    random.refresh()
    table = accuracy_by_count(
        rows, known.information, judge, fresh, counts, criterion=criterion, priors=priors
    )
    pose_set = ordered(pool.take(np.array(chosen.chosen)), margin)
    return Design(
        pose_set=pose_set,
        labels=labels_for(count),
        criterion=criterion,
        readings=readings.says,
        priors=priors,
        candidates=candidates,
        accuracy=fresh.accuracy(chosen.C),
        random=fresh.accuracy(random.C),
        by_count=tuple(table),
        length=path_length(machine, pose_set.q),
    )


def misses(design: Design, readings: Readings, fresh: PoseSet) -> float:
    """How far off the platform is predicted to be at fresh poses, mm RMS, a turn by its ``LEVER``.

    Designs that were sought apart are compared by it, at the same fresh poses.
    """
    known = prior(design.pose_set, readings, priors=design.priors)
    rows = whitened_rows(design.pose_set, readings, known.scale)
    flat = rows.reshape(len(rows), -1)
    weight = Judge.over(fresh, readings, known.scale).weight(LEVER)
    off = float(np.sum(covariance(known.information + flat @ flat.T) * weight))
    return float(np.sqrt(max(off, 0.0)))


def lengthened(
    design: Design,
    more: PoseSet,
    readings: Readings,
    generator: np.random.Generator,
    margin: Margin | None = None,
) -> Design:
    """A design with more poses behind its own, in their order, and what all of them will give.

    Raises
    ------
    BadInput
        Naming the stretch of the way that leaves the limits.
    """
    machine = design.machine
    whole = joined_poses(machine, [design.pose_set, more])
    _check_way(whole, margin)
    known = prior(whole, readings, priors=design.priors)
    rows = whitened_rows(whole, readings, known.scale)
    fresh = Judge.over(sample_poses(machine, FRESH, generator), readings, known.scale)
    information = known.information + np.einsum("pin,qin->pq", rows, rows)
    return replace(
        design,
        pose_set=whole,
        labels=labels_for(whole.count),
        accuracy=fresh.accuracy(covariance(information)),
        length=path_length(machine, whole.q),
    )


def ordered(pose_set: PoseSet, margin: Margin | None = None) -> PoseSet:
    """Poses in the order of a short path that stays within limits, a margin kept free of them.

    Raises
    ------
    BadInput
        Naming the stretch that leaves them.
    """
    pose_set = pose_set.take(short_order(pose_set.machine, pose_set.q))
    _check_way(pose_set, margin)
    return pose_set


def _check_way(pose_set: PoseSet, margin: Margin | None) -> None:
    machine = pose_set.machine
    faults = check_path(machine, pose_set.q, margin)
    if faults:
        fault = faults[0]
        ends = [f"pose {k}" if k else "home" for k in (fault.start, fault.end)]
        seen = fault.violation
        raise BadInput(
            f"between {ends[0]} and {ends[1]} {seen.what} is {seen.value:g} {seen.unit}",
            place=machine.source,
            remedy="Try another seed, or narrow [workspace].",
        )
