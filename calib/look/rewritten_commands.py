"""Coordinates of actuators that part of a run has otherwise: columns exchanged, a sign turned.

A program that was restarted with another table of axes does this, or a sensor that was plugged in
the other way round: up to there, and perhaps from somewhere on again, the file is right. (Where it
is wrong throughout, :mod:`calib.look.conventions` refuses it.)
"""

from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from calib.arrays import Array, BoolArray
from calib.errors import BadInput
from calib.identify.alignment import misfit
from calib.look.command_ways import of_commands
from calib.look.places import Places
from calib.look.proposal import Proposal
from calib.look.way import Way
from calib.mechanism.rigid import rotate
from calib.mechanism.solve import forward
from calib.runs.record import Run
from calib.runs.remark import Remark, lines_in_words, ranges

MOST = 0.9
"""Part of the readings on the platform beyond which the file is wrong throughout."""
AGREE = 0.9
"""Part of the readings of the stretch that must stand in their nests when it is read otherwise."""
LEAST_POSES = 3
"""Poses that the stretch must have: of fewer it is a pose that was mistyped."""


@dataclass(frozen=True, eq=False)
class _Stretch:
    """The way, which of the N readings it is of, and how many more stand in their nests with it."""

    way: Way
    which: BoolArray
    more: int


def rewritten_commands(places: Places) -> Proposal | None:
    """The one other way of writing q, in one stretch of rows, that brings most to their nests."""
    frame, inside = places.majority
    on = places.rows.on_platform
    if int((on & ~inside).sum()) < places.limit:
        return None
    best: _Stretch | None = None
    for way in of_commands(places.rows.machine, places.run):
        base = _standing(places, way.run)
        if base is None:
            continue
        found = _stretch(places, way, np.where(on, misfit(base, places.seen, *frame), np.inf))
        if found is not None and (best is None or found.more > best.more):
            best = found
    if best is None:
        return None
    return Proposal(int(inside.sum()) + best.more, partial(_taken, places, best))


def _standing(places: Places, run: Run) -> Array | None:
    """Places (3, N) of the labelled nests by the coordinates of ``run``; NaN where it cannot be."""
    rows = places.rows
    q = run.q[:, run.measured]
    held = run.header.controller_parameters
    try:
        with np.errstate(all="ignore"):
            poses = forward(rows.machine, rows.machine.extension(q, held)).poses
    except BadInput:
        return None
    return np.asarray(poses.position + rotate(poses.rotation, rows.nest))


def _stretch(places: Places, way: Way, apart: Array) -> _Stretch | None:
    """The stretch of readings that gains most by ``way``, with which they are ``apart`` (N,) mm."""
    frame, inside = places.majority
    on, slack = places.rows.on_platform, places.slack
    now = misfit(places.base, places.seen, *frame)
    gain = np.where(on, np.minimum(now / slack, 1.0) - np.fmin(apart / slack, 1.0), 0.0)
    total = np.concatenate([[0.0], np.cumsum(gain)])
    lowest = np.minimum.accumulate(total)
    last = int(np.argmax(total - lowest))
    first = int(np.argmin(total[: last + 1]))
    which = np.zeros_like(on)
    which[first:last] = True
    which &= on
    here, fits = int(which.sum()), apart < slack
    if here == 0 or here > MOST * on.sum() or fits[which].mean() < AGREE:
        return None
    poses = np.unique(places.rows.q[:, which], axis=1).shape[1]
    more = int(fits[which].sum() - inside[which].sum())
    if poses < LEAST_POSES or more < places.limit:
        return None
    return _Stretch(way, which, more)


def _taken(places: Places, found: _Stretch) -> tuple[Run, Remark]:
    run = places.run
    read = np.flatnonzero(run.measured)
    rows, on = read[found.which], read[places.rows.on_platform]
    after = on[on > rows[-1]]
    stretch = np.zeros_like(run.measured)
    stretch[rows[0] : after[0] if after.size else None] = True
    lines = ranges(run.line[rows], run.line[on])
    now = int(places.majority[1][found.which].sum())
    return replace(run, q=np.where(stretch, found.way.run.q, run.q)), Remark(
        "q-rewritten",
        f"In {lines_in_words(lines)} {found.way.says}",
        lines,
        f"Read so, {found.more} more of these {rows.size} readings stand in their nests; as it is "
        f"written {now} do",
        "Read so; nothing is excluded for it",
        f"{found.way.remedy} in these lines",
        True,
        run.source,
    )
