"""Columns q that stand some rows, or a pose, too late or too early; labels and readings do not.

A program that logs the command before the last one does this: the label of a pose then stands for
two commands wherever the machine moved, though every pose was commanded once.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import BoolArray, IntArray
from calib.look.places import FEW, Places, places_of
from calib.look.pose_labels import shared_labels
from calib.look.slid import ROWS, rows_in_words
from calib.mechanism.description import Machine
from calib.runs.record import Run
from calib.runs.remark import Remark, lines_in_words, ranges

MANY = 3
"""Labels that must stand for two commands."""
MOST_LOST = 3
"""Readings at either end whose command may stand nowhere in the file."""
ENOUGH = 0.9
"""Part of the readings that must stand in their nests once q is put back."""


def slid_commands(machine: Machine, run: Run, *, nowhere: bool = False) -> tuple[Run, list[Remark]]:
    """Put q back where many labels stand for two poses, and for one each then.

    ``nowhere``: the readings stand in no nest; q is tried though labels show nothing, as when each
    nest was read at all poses in turn.
    """
    shared = shared_labels(machine, run)
    if len(shared) <= MANY and not nowhere:
        return run, []
    own = places_of(machine, run)
    best: _Put | None = None
    for what, source in _sources(run):
        put = _put_back(machine, run, own, what, source)
        if put is None or (best is not None and put.standing <= best.standing):
            continue
        if len(shared_labels(machine, put.run)) <= max(MANY, len(shared) // 4):
            best = put
    standing = 0 if own is None else own.standing
    if best is None or best.standing < max(ENOUGH * run.readings, standing + 1):
        return run, []
    changed, lost = best.changed, _lost(machine, best.run)
    aside = f"; {int(lost.sum())} whose own command is nowhere are set aside" if lost.any() else ""
    return replace(best.run, measured=run.measured & ~lost), [
        Remark(
            "rows-shifted",
            f"q1.. stand {best.what}"
            + ("" if best.whole else f" in {lines_in_words(ranges(run.line[changed], run.line))}"),
            ranges(run.line[changed], run.line),
            f"With q put back {best.standing} of {run.readings} readings stand in their nests, as "
            f"it is written {standing} do; {len(shared)} labels stand for two commands",
            f"Fitted with q put back{aside}",
            "Write in each row what was commanded when it was read",
            True,
            run.source,
        )
    ]


@dataclass(frozen=True, eq=False)
class _Put:
    """The run with q put back, which rows were changed, and how many readings stand then."""

    run: Run
    what: str
    changed: BoolArray
    standing: int
    whole: bool


def _sources(run: Run) -> Iterator[tuple[str, IntArray]]:
    """Ways in which q may have slid: in words, and the row (N,) whose q belongs to each row."""
    on = np.array([name in run.header.platform_nests for name in run.nest]) & run.measured
    sets = [np.arange(run.line.size), np.flatnonzero(run.measured), np.flatnonzero(on)]
    for by in ROWS:
        for rows in sets:
            if rows.size > 1:
                source = np.arange(run.line.size)
                source[rows] = rows[np.clip(np.arange(rows.size) + by, 0, rows.size - 1)]
                late = "too late" if by > 0 else "too early"
                of = "before" if by > 0 else "after"
                told = f": they are those of the row {of}" if abs(by) == 1 else ""
                yield f"{rows_in_words(by)} {late}{told}", source
    for rows in sets[1:]:
        if rows.size > 1:
            yield from _by_stops(run, rows)


def _by_stops(run: Run, rows: IntArray) -> Iterator[tuple[str, IntArray]]:
    """q of the stop before, or after: logged a command too late, or before it was carried out."""
    new = np.any(np.diff(run.q[:, rows], axis=1) != 0.0, axis=0)
    first = rows[np.concatenate([[0], np.flatnonzero(new) + 1])]
    stop = np.concatenate([[0], np.cumsum(new)])
    for by, of in ((1, "before"), (-1, "after")):
        source = np.arange(run.line.size)
        source[rows] = first[np.clip(stop + by, 0, first.size - 1)]
        yield (
            f"one pose too {'late' if by > 0 else 'early'}: they are those of the pose {of}",
            (source),
        )


def _put_back(
    machine: Machine, run: Run, own: Places | None, what: str, source: IntArray
) -> _Put | None:
    """The run with q from ``source``, throughout or on one side of the reading that parts best."""
    put = replace(run, q=run.q[:, source])
    places = places_of(machine, put)
    if places is None:
        return None
    rows = np.arange(run.line.size)
    changed = np.any(put.q != run.q, axis=0)
    whole = _Put(put, what, changed, places.standing, whole=True)
    if own is None:
        return whole
    frame = (places if places.standing >= own.standing else own).majority[0]
    here, there = own.inside(frame), places.inside(frame)
    best = whole
    for first, second, late in ((here, there, True), (there, here, False)):
        before = np.concatenate([[0], np.cumsum(first)])
        after = np.concatenate([np.cumsum(second[::-1])[::-1], [0]])
        at = int(np.argmax(before + after))
        standing = int((before + after)[at])
        if not 0 < at < here.size or standing < best.standing + FEW:
            continue
        row = int(np.flatnonzero(run.measured)[at])
        which = changed & ((rows >= row) == late)
        meant = replace(run, q=np.where(which, put.q, run.q))
        best = _Put(meant, what, which, standing, whole=False)
    return best


def _lost(machine: Machine, put: Run) -> BoolArray:
    """Rows (N,) at either end whose own command stands nowhere: those that stand in no nest."""
    places, lost = places_of(machine, put), np.zeros(put.line.size, dtype=bool)
    if places is None:
        return lost
    on = np.flatnonzero(places.rows.on_platform)
    ends = np.concatenate([on[:MOST_LOST], on[-MOST_LOST:]])
    lost[np.flatnonzero(put.measured)[ends[~places.majority[1][ends]]]] = True
    return lost
