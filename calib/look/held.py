"""An actuator that no longer went where it was commanded: clamped, or off by one jump."""

from dataclasses import replace
from functools import partial

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.errors import BadInput
from calib.identify.alignment import collinear, misfit, robust_align
from calib.look.places import Places
from calib.look.proposal import Proposal
from calib.mechanism.rigid import rotate
from calib.mechanism.solve import forward
from calib.runs.record import Run
from calib.runs.remark import Remark, ranges

LEAST = 4
"""Readings on the platform that such an actuator must have moved."""
AGREE = 0.9
"""Part of the readings from the moment on that must be explained."""
BACK = 12
"""Readings before the moment at which such an actuator may already have stood."""
SPLIT = 0.8
"""Part of the readings that such a moment must part into good ones and others."""
JUMP_STEPS = 4
"""Corrections of a jump: the machine bends on its way."""


def held_actuator(places: Places) -> Proposal | None:
    """One actuator that stood still, or was off by one amount, from some reading on."""
    on = places.rows.on_platform
    _, inside = places.majority
    at = _moment(inside[on])
    platform = np.flatnonzero(on)
    if at is None or platform.size - at < LEAST or at < LEAST:
        return None
    early = np.flatnonzero(~on | (np.arange(on.size) < platform[at]))
    if collinear(places.base[:, early]):
        return None
    rotation, position, _ = robust_align(
        places.base[:, early], places.seen[:, early], places.slack[early]
    )
    late = platform[at:]
    best: Proposal | None = None
    for k in range(places.rows.q.shape[0]):
        for other, says in ((_still, "clamped"), (_jumped, "slipped")):
            q = other(places, k, late, int(platform[at - 1]), (rotation, position))
            base = None if q is None else _standing(places, q, late)
            if q is None or base is None:
                continue
            fits = misfit(base, places.seen[:, late], rotation, position) < places.slack[late]
            explained = int(places.inside((rotation, position))[early].sum() + fits.sum())
            if fits.mean() > AGREE and (best is None or explained > best.explained):
                change = float(q[k, 0] - places.rows.q[k, late[0]])
                best = Proposal(explained, partial(_taken, places, k, q, late, says, change))
    return best


def _moment(inside: BoolArray) -> int | None:
    """The reading from which on most stand in no nest, those before in theirs."""
    before = np.concatenate([[0], np.cumsum(inside)])
    after = np.concatenate([np.cumsum(~inside[::-1])[::-1], [0]])
    at = int(np.argmax(before + after))
    return at if 0 < at < inside.size and (before + after)[at] > SPLIT * inside.size else None


def _still(
    places: Places, k: int, late: IntArray, last: int, frame: tuple[Array, Array]
) -> Array | None:
    """Commands of an actuator that stands where it was last commanded to before it froze."""
    q = places.rows.q[:, late].copy()
    q[k] = places.rows.q[k, last]
    meant = _pulled(places, k, q, late, frame)
    if meant is None:
        return None
    stops = places.rows.q[k, max(0, last - BACK) : late[0] + 1]
    q[k] = stops[np.argmin(np.abs(stops - meant[k, 0]))]
    return q


def _jumped(
    places: Places, k: int, late: IntArray, last: int, frame: tuple[Array, Array]
) -> Array | None:
    """Commands off by the one amount of actuator ``k`` that explains most."""
    return _pulled(places, k, places.rows.q[:, late].copy(), late, frame)


def _pulled(
    places: Places, k: int, q: Array, late: IntArray, frame: tuple[Array, Array]
) -> Array | None:
    """``q`` (n, M) with the one amount added to actuator ``k`` with which the nests fit best."""
    step = 1e-3 * float(np.ptp(places.rows.machine.q_limits[k]))
    if not np.isfinite(step):
        return None
    seen = frame[0].T @ (places.seen[:, late] - frame[1][:, None])
    for _ in range(JUMP_STEPS):
        moved = q.copy()
        moved[k] += step
        here, there = _standing(places, q, late), _standing(places, moved, late)
        if here is None or there is None:
            return None
        slope = (there - here) / step
        q[k] += float(np.sum(slope * (seen - here)) / np.sum(slope * slope))
    return q


def _standing(places: Places, q: Array, which: IntArray) -> Array | None:
    rows = places.rows
    held = places.run.header.controller_parameters
    try:
        with np.errstate(all="ignore"):
            poses = forward(rows.machine, rows.machine.extension(q, held)).poses
    except BadInput:
        return None
    base = poses.position + rotate(poses.rotation, rows.nest[:, which])
    return base if np.all(np.isfinite(base)) else None


def _taken(
    places: Places, k: int, q: Array, late: IntArray, what: str, change: float
) -> tuple[Run, Remark]:
    run, rows = places.run, places.rows
    read = np.flatnonzero(run.measured)[late]
    first, own = int(read[0]), run.q.copy()
    if what == "clamped":  # from the last row on at which it was commanded there
        first = int(np.flatnonzero(run.q[k, : first + 1] == q[k, 0])[-1])
    from_here = np.arange(run.line.size) >= first
    axis = rows.machine.actuators[k]
    if what == "clamped":
        own[k, from_here] = q[k, 0]
        says = f"{axis.name} no longer moved from line {run.line[first]} on: it stood at " + (
            f"{q[k, 0]:.6g} {axis.unit}"
        )
    else:
        own[k, from_here] += change
        says = (
            f"{axis.name} is off by {change:+.4g} {axis.unit} from line {run.line[first]} on: it "
            "slipped or lost counts"
        )
    return replace(run, q=own), Remark(
        f"actuator-{what}",
        says,
        ranges(run.line[read], run.line[run.measured]),
        f"So {late.size} readings stand in their nests, by the commands they do not",
        f"Fitted with {axis.name} where it stood",
        f"See {axis.name} and its drive, home it, and measure again from there on",
        True,
        run.source,
    )
