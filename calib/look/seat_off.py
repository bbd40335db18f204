"""A nest that is off as one, in the whole run or a part, by what a fit leaves."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.identify.fitting import Fit
from calib.look.scan import excess, fit_of, scan, with_the_excluded
from calib.look.seats import ALONG, lifted, normal_of, seated
from calib.mechanism.description import Machine
from calib.mechanism.rigid import rotate
from calib.runs.record import Run
from calib.runs.remark import Remark

FALL = 100.0
"""Least fall of the cost by which a seat is held."""
SEAT_SHARE = 0.9
"""Least part of the misfit that a seat must explain: angles of the tracker bend nests alike."""
CLEAR = 30.0
"""Fall of chi-square by which a seat that changed must beat one that was off throughout."""
LEAST = 3
"""Readings on either side of a change."""
SMALLEST_SEAT, SMALLEST_ASIDE = 0.3, 0.5
"""Offset of a nest, mm, below which it is a matter of the effect nest-offset; and off its normal.

No reflector makes an offset that is not along the normal: there it must be larger, and explain all.
"""
ASIDE_SHARE = 0.97
REFINED = 3
"""Fits that put a seat where it was read; the first ones are bent by it, or exclude it."""
SMALL_MM = 0.01
"""Correction, mm, below which a seat stays."""


@dataclass(frozen=True, eq=False)
class Seat:
    """A nest that is off by ``offset`` (3,) mm in the rows ``which`` (N,).

    ``room``: in the base frame, whatever the platform does; else in the platform frame.
    """

    name: str
    room: bool
    which: BoolArray
    offset: Array
    fall: float


def seat_off(fitted: Fit) -> Seat | None:
    """The nest whose offset, in the whole run or a part, explains the misfit."""
    rows = fitted.model.rows
    header = rows.runs[0].header
    names = np.array(rows.nest_name, dtype=object)
    kept = np.flatnonzero(fitted.accepted)
    best: Seat | None = None
    for name in header.platform_nests:
        named = names == name
        own = named & fitted.accepted
        at = np.flatnonzero(own[kept])
        if at.size <= LEAST:
            continue
        for room, early in product((False, True), (False, True)):
            normal = np.array([0.0, 0.0, 1.0]) if room else normal_of(header)
            tried = at[LEAST:] if early else at[: at.size - LEAST]
            tries = scan(fitted, seat_columns(fitted, own, room=room), early=early)
            edge = int(tried[np.argmax(tries.fall[tried])])
            whole = int(at[-1] if early else at[0])
            if tries.fall[whole] > tries.fall[edge] - CLEAR:
                edge = whole
            which = named & ((np.arange(own.size) <= kept[edge]) == early)
            which[kept[edge]] = True
            if edge == whole:
                which = named
            found = Seat(name, room, which, tries.sizes[edge], float(tries.fall[edge]))
            if not _seems_moved(found, normal, excess(fitted)):
                continue
            if best is None or found.fall > best.fall:
                best = found
    return best


def _seems_moved(seat: Seat, normal: Array, misfit: float) -> bool:
    """Whether an offset is large enough, and explains enough of a misfit, to be of the record."""
    size = float(np.linalg.norm(seat.offset))
    along = abs(float(normal @ seat.offset)) >= ALONG * size
    least, share = (SMALLEST_SEAT, SEAT_SHARE) if along else (SMALLEST_ASIDE, ASIDE_SHARE)
    return size >= least and seat.fall >= max(FALL, share * misfit)


def seat_columns(fitted: Fit, which: BoolArray, *, room: bool) -> Array:
    """Whitened columns (3, 3, A) of moving the SMR of some readings, platform or base frame."""
    situation = fitted.linear.situation
    unit = np.repeat(np.eye(3)[:, :, None], which.size, axis=2) * which
    turned = unit if room else np.stack([rotate(situation.rotation, one) for one in unit])
    whitened = np.einsum("ijn,kjn->kin", situation.whitened_frame, turned)
    return np.asarray(whitened[:, :, fitted.accepted], dtype=np.float64)


def each_seat(fitted: Fit) -> Iterator[Array]:
    """Columns (3, 3, A) of moving each nest of the platform that was read, in its frame."""
    rows = fitted.model.rows
    names = np.array(rows.nest_name, dtype=object)
    for name in rows.runs[0].header.platform_nests:
        if np.any((names == name) & fitted.accepted):
            yield seat_columns(fitted, names == name, room=False)


def reseated(machine: Machine, run: Run, fitted: Fit, seat: Seat) -> tuple[Run, Remark]:
    """Move the nest to where it was read; more fits correct what the first one was bent by."""
    lines = fitted.model.rows.line[seat.which]
    frame = fitted.linear.state.frame_rotation[:, :, 0]
    offset = seat.offset

    def taken(offset: Array) -> tuple[Run, Remark]:
        if seat.room:
            return lifted(run, seat.name, lines, offset, frame)
        return seated(run, seat.name, lines, offset)

    for _ in range(REFINED):
        more = _left(machine, taken(offset)[0], lines, room=seat.room)
        offset = offset + more
        if np.linalg.norm(more) < SMALL_MM:
            break
    return taken(offset)


def seat_refined(machine: Machine, before: Run, run: Run) -> Run:
    """The run with a seat, which was seen by the nominal machine, where fits put it."""
    old, table = before.header.platform_nests, run.header.platform_nests
    names = [n for n in table if n not in old or not np.array_equal(old[n], table[n])]
    if len(names) != 1:
        return run
    lines = run.line[[nest == names[0] for nest in run.nest]]
    for _ in range(REFINED):
        more = _left(machine, run, lines, room=False)
        table = run.header.platform_nests
        moved = {**table, names[0]: table[names[0]] + more}
        run = replace(run, header=replace(run.header, platform_nests=moved))
        if np.linalg.norm(more) < SMALL_MM:
            break
    return run


def _left(machine: Machine, run: Run, lines: IntArray, *, room: bool) -> Array:
    """How far (3,) readings of a nest in some lines are off still; zero if nothing can be fitted.

    A fit that left some of them out is asked with them.
    """
    fitted = fit_of(machine, run)
    if fitted is None:
        return np.zeros(3)
    here = np.isin(fitted.model.rows.line, lines)
    if not fitted.accepted[here].all():
        fitted = with_the_excluded(fitted)
    columns = seat_columns(fitted, here & fitted.accepted, room=room)
    return np.asarray(scan(fitted, columns).sizes[0])
