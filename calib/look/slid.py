"""Rows whose readings slid by one, and columns of q that were not written down."""

from dataclasses import replace
from functools import partial

import numpy as np

from calib.arrays import Array, BoolArray
from calib.errors import BadInput
from calib.identify.alignment import robust_align
from calib.look.places import Frame, Places
from calib.look.proposal import Proposal
from calib.runs.record import Run
from calib.runs.remark import Remark, ranges

ROWS = (1, -1, 2, -2, 3, -3)
"""Rows by which columns slide."""
ENOUGH = 0.9
"""Part of them that must stand in their nests once it is taken otherwise."""


def check_columns(places: Places) -> None:
    """Refuse a column of q that holds one number throughout; raises BadInput naming it."""
    on = np.flatnonzero(places.rows.on_platform)
    if on.size == 0:
        return
    still = np.ptp(places.rows.q[:, on], axis=1) == 0.0
    if (
        still.sum() == 1
        and still.size > 1
        and _share(places.base, places.seen, places.tight) < ENOUGH
    ):
        k = int(np.argmax(still))
        raise _refused(
            places,
            f"column q{k + 1} repeats {places.rows.q[k, on[0]]:g} in all rows while the other "
            "actuators move, and so the readings stand in no nest",
            f"Write what q{k + 1} was commanded in each row",
        )


def _share(base: Array, seen: Array, slack: Array) -> float:
    return float(robust_align(base, seen, slack)[2].mean())


def _refused(places: Places, what: str, remedy: str) -> BadInput:
    return BadInput(what, place=places.run.source, remedy=remedy)


def slid_rows(places: Places) -> Proposal | None:
    """Readings that stand a row too late, or too early, from some row on or throughout."""
    best: Proposal | None = None
    count = places.rows.count
    for by in ROWS:
        base = np.roll(places.base, by, axis=1)
        edge = slice(0, by) if by > 0 else slice(count + by, count)
        rotation, position, inside = robust_align(base, places.seen, places.slack)
        inside[edge] = False
        for frame, slid in (
            ((rotation, position), inside),
            (places.majority[0], _inside_of(places, base, places.majority[0], edge)),
        ):
            own = places.inside(frame)
            before = np.concatenate([[0], np.cumsum(own)])
            after = np.concatenate([np.cumsum(slid[::-1])[::-1], [0]])
            at = int(np.argmax(before + after))
            explained = int((before + after)[at])
            if explained < ENOUGH * count or at > count - 4 - abs(by):
                continue
            if best is None or explained > best.explained:
                best = Proposal(explained, partial(_put_back, places, at, by))
    return best


def rows_in_words(by: int) -> str:
    """``one row``, ``two rows``."""
    return ("one row", "two rows", "three rows")[abs(by) - 1]


def _inside_of(places: Places, base: Array, frame: Frame, edge: slice) -> BoolArray:
    found = places.inside(frame, base)
    found[edge] = False
    return found


def _put_back(places: Places, at: int, by: int) -> tuple[Run, Remark]:
    """The run with the readings from ``at`` on moved ``by`` rows back."""
    run = places.run
    read = np.flatnonzero(run.measured)
    position, covariance = run.position.copy(), run.covariance.copy()
    measured = run.measured.copy()
    here = np.arange(max(at - by, 0) if by > 0 else at, read.size)
    source = here + by
    good = (source >= 0) & (source < read.size)
    position[:, read[here[good]]] = run.position[:, read[source[good]]]
    covariance[:, :, read[here[good]]] = run.covariance[:, :, read[source[good]]]
    measured[read[here[~good]]] = False
    late = f"{rows_in_words(by)} too {'late' if by > 0 else 'early'}"
    lines = ranges(run.line[read[here]], run.line[read])
    where = "in all rows" if at <= abs(by) else f"from line {run.line[read[at]]} on"
    return replace(run, position=position, covariance=covariance, measured=measured), Remark(
        "rows-shifted",
        f"x, y, z stand {late} {where}: a reading was lost or written twice",
        lines,
        "Each reading stands where the nest of another row was, not its own",
        f"Fitted with x, y, z put back by {rows_in_words(by)}",
        f"Put x, y, z back by {rows_in_words(by)} {where}",
        True,
        run.source,
    )
