"""Columns q that stand a row too late, or too early, beside labels and readings that do not.

A program that logs the command before the last one does this: the label of a pose then stands for
two commands wherever the machine moved, though every pose was commanded once.
"""

from dataclasses import replace

import numpy as np

from calib.arrays import Array, IntArray
from calib.look.places import places_of
from calib.look.pose_labels import shared_labels
from calib.mechanism.description import Machine
from calib.runs.record import Run
from calib.runs.remark import Remark, ranges

MANY = 3
"""Labels that must stand for two commands."""
ENOUGH = 0.9
"""Part of the readings that must stand in their nests once q is put back."""


def slid_commands(machine: Machine, run: Run, *, nowhere: bool = False) -> tuple[Run, list[Remark]]:
    """Put q back by one row where many labels stand for two poses, and for one each then.

    ``nowhere``: the readings stand in no nest; q is tried though labels show nothing, as when each
    nest was read at all poses in turn.
    """
    shared = shared_labels(machine, run)
    if len(shared) <= MANY and not nowhere:
        return run, []
    best: tuple[int, Run, IntArray, int] | None = None
    for by in (1, -1):
        for rows in _columns(run):
            put = _put_back(run, rows, by)
            if len(shared_labels(machine, put)) > max(MANY, len(shared) // 4):
                continue
            count = _in_nests(machine, put)
            if best is None or count > best[0]:
                best = (count, put, rows, by)
    if best is None or best[0] < max(ENOUGH * run.readings, _in_nests(machine, run) + 1):
        return run, []
    _, put, rows, by = best
    changed = rows[np.any(put.q[:, rows] != run.q[:, rows], axis=0)]
    late = "late" if by > 0 else "early"
    return put, [
        Remark(
            "rows-shifted",
            f"q1.. stand one row too {late}: they are those of the row "
            f"{'before' if by > 0 else 'after'}",
            ranges(run.line[changed], run.line[rows]),
            f"With q put back {best[0]} of {run.readings} readings stand in their nests; "
            f"{len(shared)} labels stand for two commands as it is written",
            "Fitted with q put back by one row",
            "Write in each row what was commanded when it was read",
            True,
            run.source,
        )
    ]


def _columns(run: Run) -> list[IntArray]:
    """Rows over which q may have slid: all of them, those with readings, those on the platform."""
    on = np.array([name in run.header.platform_nests for name in run.nest]) & run.measured
    found: list[IntArray] = [np.arange(run.line.size)]
    found += [rows for rows in (np.flatnonzero(run.measured), np.flatnonzero(on)) if rows.size > 1]
    return found


def _put_back(run: Run, rows: IntArray, by: int) -> Run:
    """The run with q of ``rows`` taken from the row after (by = 1) or before (-1) among them."""
    source = np.clip(np.arange(rows.size) + by, 0, rows.size - 1)
    q: Array = run.q.copy()
    q[:, rows] = run.q[:, rows[source]]
    return replace(run, q=q)


def _in_nests(machine: Machine, run: Run) -> int:
    places = places_of(machine, run)
    return 0 if places is None else int(places.majority[1].sum())
