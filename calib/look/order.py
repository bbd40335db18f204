"""Whether rows stand in the order in which they were measured: sorted columns, sensors that zigzag.

A temperature goes its way smoothly from reading to reading. Where it does so in another order of
the rows (by nest, then pose; by pose, then nest; base nests visit by visit) and zigzags as they
stand, the rows were put into another order afterwards, whatever their times say.
"""

from collections import Counter
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from calib.arrays import Array, IntArray
from calib.runs.record import Run
from calib.runs.remark import Remark

LEAST = 20
"""Fewest readings of which an order is asked."""
SMOOTHER = 0.35
"""Part of the way that a temperature goes, below which another order is the true one."""
LEAST_K = 0.5
"""Least range, K, of a temperature that tells an order."""
LEAST_BASE = 6
"""Fewest readings of nests on the base that tell theirs."""
CHANGING = 0.8
"""Part of the rows at which both nest and pose change, though poses come again."""


def order_of_rows(run: Run) -> list[Remark]:
    """Say that the rows were sorted or shuffled after the measurement."""
    read = np.flatnonzero(run.measured)
    if read.size < LEAST:
        return []
    name = sorted_column(run)
    if name:
        return [
            _remark(
                run, f"The rows are sorted by {name}",
                f"{name} never falls from one reading to the next in {read.size} readings",
            )
        ]  # fmt: skip
    zigzag = _zigzag(run, read)
    if zigzag:
        return [_remark(run, "The rows were sorted or shuffled after the measurement", zigzag)]
    if _mixed(run, read):
        return [
            _remark(
                run, "The rows seem to be shuffled",
                "Nest and pose change together at almost every reading, and poses come again: "
                "nobody carries an SMR so",
            )
        ]  # fmt: skip
    return []


def sorted_column(run: Run) -> str:
    """Name of one of x, y, z that only rises or only falls, while readings visit nests again."""
    read = np.flatnonzero(run.measured)
    nests = [run.nest[k] for k in read]
    again = sum(a != b for a, b in pairwise(nests)) + 1 > len(set(nests))
    if read.size < LEAST or not again:
        return ""
    for axis, name in enumerate("xyz"):
        step = np.diff(run.position[axis, read])
        if np.all(step >= 0.0) or np.all(step <= 0.0):
            return name
    return ""


def _zigzag(run: Run, read: IntArray) -> str:
    """The temperature that goes smoothly in another order, in words; empty if none does."""
    on = np.array([run.nest[k] in run.header.platform_nests for k in read])
    for name, values in run.channels.items():
        if not name.endswith("_C") or name.startswith("air"):
            continue
        for rows, orders, least in (
            (read[on], _by_label(run, read[on]), LEAST),
            (read[~on], _by_visit(run, read[~on]), LEAST_BASE),
        ):
            known = np.isfinite(values[rows])
            if known.sum() < max(least, 0.9 * rows.size) or np.ptp(values[rows][known]) < LEAST_K:
                continue
            stands = _way(values[rows])
            smooth = min((_way(values[other]) for other in orders), default=stands)
            if smooth < SMOOTHER * stands:
                return (
                    f"{name} goes up and down by {stands:.3g} K in all as the rows stand, and by "
                    f"{smooth:.3g} K if they are put by nest and pose"
                )
    return ""


def _way(values: Array) -> float:
    return float(np.nansum(np.abs(np.diff(values))))


def _by_label(run: Run, rows: IntArray) -> Sequence[IntArray]:
    """Rows on the platform by nest, then pose, and by pose, then nest."""
    try:
        pose = np.array([float(run.pose[k]) for k in rows])
    except ValueError:
        return ()
    nest = np.array([run.nest[k] for k in rows])
    _, nest = np.unique(nest, return_inverse=True)
    return rows[np.lexsort((pose, nest))], rows[np.lexsort((nest, pose))]


def _by_visit(run: Run, rows: IntArray) -> Sequence[IntArray]:
    """Rows of nests on the base, the first reading of each nest first, then the second."""
    seen: Counter[str] = Counter()
    turn = []
    for k in rows:
        seen[run.nest[k]] += 1
        turn.append(seen[run.nest[k]])
    return (rows[np.argsort(turn, kind="stable")],) if len(seen) > 1 else ()


def _mixed(run: Run, read: IntArray) -> bool:
    """Whether nest and pose change together almost everywhere, and poses are come back to."""
    on = np.array([k for k in read if run.nest[k] in run.header.platform_nests and run.pose[k]])
    if on.size < LEAST:
        return False
    nest = np.array([run.nest[k] for k in on])
    pose = np.array([run.pose[k] for k in on])
    changes = (nest[1:] != nest[:-1]) & (pose[1:] != pose[:-1])
    visits = 1 + int(np.sum(pose[1:] != pose[:-1]))
    several = len({(a, b) for a, b in zip(nest, pose, strict=True)}) > 1.5 * len(set(pose))
    # An SMR that stays in its nest makes one change a pass, several in all nests none at a pose.
    by_chance = 1.0 - float(np.sum([np.mean(nest == n) ** 2 for n in set(nest)]))
    return several and visits > 2 * len(set(pose)) and changes.mean() > CHANGING * by_chance


def _remark(run: Run, says: str, evidence: str) -> Remark:
    return Remark(
        "rows-sorted",
        f"{says}: their order is not that of measuring",
        (),
        evidence,
        "Taken as it stands; what depends on order, direction of approach or time means nothing "
        "here",
        "Write the rows in the order in which they were measured, with their own times",
        False,
        run.source,
    )
