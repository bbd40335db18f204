"""A station that was moved: from some reading on everything stands in another frame.

Two frames explain the readings before and after with six unknowns more; the other readings need
not be excluded. One step is handed to the effect ``frame-shift`` with its moment and its size;
where there are several, the parts become runs with frames of their own.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.digits import length
from calib.identify.alignment import collinear, robust_align
from calib.look.places import Frame, Places
from calib.look.proposal import Proposal
from calib.mechanism.rigid import logarithm
from calib.runs.record import Run
from calib.runs.remark import Remark, ranges

LEAST = 4
"""Readings that a frame of its own needs."""
AGREE = 0.8
"""Part of the readings after a step that must fit the frame after it."""
MOST_STEPS = 4
FAR_MM, FAR_RAD = 200.0, 0.1
"""A step beyond this is another station: the readings after it have a frame of their own."""


@dataclass(frozen=True)
class Step:
    """The frame changes between readings ``at`` - 1 and ``at``."""

    at: int
    before: Frame
    after: Frame


def moved_station(places: Places) -> Proposal | None:
    """The steps of the frame with which most readings stand where their nests are."""
    steps, explained = _steps(places, np.arange(places.rows.count), MOST_STEPS)
    if not steps:
        return None
    steps.sort(key=lambda step: step.at)
    known = {}
    if len(steps) == 1 and not _set_up_anew(places, steps[0]):
        known = {"frame-shift": shift_values(places.rows.moment, steps[0])}
    return Proposal(
        int(explained.sum()), lambda: (places.run, _remark(places, steps, parted=not known)), known
    )


def parts_of(places: Places) -> list[Run]:
    """The run in parts between its steps, each with the whole way that led to its readings."""
    steps, _ = _steps(places, np.arange(places.rows.count), MOST_STEPS)
    read = np.flatnonzero(places.run.measured)
    edges = [0, *sorted(step.at for step in steps), read.size]
    parts = []
    for first, last in pairwise(edges):
        measured = np.zeros_like(places.run.measured)
        measured[read[first:last]] = True
        parts.append(replace(places.run, measured=measured))
    return parts


def shift_values(moment: Array, step: Step) -> Array:
    """The step as unknowns (8,) of ``frame-shift``: mm, rad, moment in s, 1 for the base."""
    (first, start), (second, end) = step.before, step.after
    turn = logarithm(first.T @ second)
    shift = first.T @ (end - start)
    at = 0.5 * (moment[step.at - 1] + moment[step.at])
    return np.concatenate([shift, turn, [at, 1.0]])


def _steps(places: Places, here: IntArray, most: int) -> tuple[list[Step], BoolArray]:
    """Steps among the readings ``here`` (indices), and which of all (N,) are explained then."""
    explained = np.zeros(places.rows.count, dtype=bool)
    base, seen, slack = places.base[:, here], places.seen[:, here], places.slack[here]
    if collinear(base):
        return [], explained
    rotation, position, inside = robust_align(base, seen, slack)
    explained[here[inside]] = True
    if most == 0 or here.size - inside.sum() < LEAST:
        return [], explained
    found = _best_step(base, seen, slack, inside)
    if found is None:
        return [], explained
    at, other, first = found
    frame = (rotation, position)
    before, after = (frame, other) if first else (other, frame)
    step = Step(int(here[at]), before, after)
    left, inside_left = _steps(places, here[:at], most - 1)
    right, inside_right = _steps(places, here[at:], most - 1 - len(left))
    both = inside_left | inside_right
    if both.sum() <= explained.sum():
        return [], explained
    return [*left, step, *right], both


def _best_step(
    base: Array, seen: Array, slack: Array, inside: BoolArray
) -> tuple[int, Frame, bool] | None:
    """Where the majority's readings end or begin, the other frame, and if they come first."""
    count = inside.size
    before = np.concatenate([[0], np.cumsum(inside)])
    total = before[-1]
    edges = np.arange(count + 1)
    ends = before + (count - edges) - (total - before)  # inside before it, outside after it
    begins = (edges - before) + (total - before)
    best: tuple[int, Frame, bool] | None = None
    most = -1
    for score, first in ((ends, True), (begins, False)):
        at = int(np.argmax(score))
        chosen = slice(at, count) if first else slice(0, at)
        if score[at] <= most or not 0 < at < count:
            continue
        outside = np.arange(count)[chosen]
        if outside.size < LEAST or collinear(base[:, outside]):
            continue
        rotation, position, fits = robust_align(base[:, outside], seen[:, outside], slack[outside])
        if fits.sum() < max(LEAST, AGREE * outside.size):
            continue
        most, best = int(score[at]), (at, (rotation, position), first)
    return best


def _remark(places: Places, steps: list[Step], *, parted: bool) -> Remark:
    run, rows = places.run, places.rows
    sizes = [_size(places, step) for step in steps]
    told = " and ".join(
        f"by {length(size)} before line {rows.line[step.at]} ({rows.time_s[step.at]:.0f} s)"
        for step, size in zip(steps, sizes, strict=True)
    )
    after = rows.line[min(step.at for step in steps) :]
    done = (
        "The parts between the steps have frames of their own; nothing is excluded for it"
        if parted
        else "The step is in the model as frame-shift; nothing is excluded for it"
    )
    return Remark(
        "station-moved",
        f"The tracker or the base was moved during the run: {told}",
        ranges(after, rows.line),
        f"{len(after)} readings fit one another, and the machine, in another frame; "
        f"{6 * len(steps) + len(steps)} unknowns explain them",
        done,
        "Nothing, or begin a new run after the move; fasten what was moved",
        True,
        run.source,
    )


def _set_up_anew(places: Places, step: Step) -> bool:
    """Whether a station stands so far from where it stood that it was not pushed but set up."""
    turn = float(np.linalg.norm(logarithm(step.before[0].T @ step.after[0])))
    return turn > FAR_RAD or _size(places, step) > FAR_MM


def _size(places: Places, step: Step) -> float:
    """How far (mm) the middle of the readings was moved."""
    middle = places.base.mean(axis=1)
    (first, start), (second, end) = step.before, step.after
    return float(np.linalg.norm(second @ middle + end - first @ middle - start))
