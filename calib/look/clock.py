"""``time_s``: its unit, and clocks that stand still or count rows."""

from dataclasses import replace

import numpy as np

from calib.arrays import Array, IntArray
from calib.runs.record import Run
from calib.runs.remark import Remark, lines_in_words, ranges

FASTEST = 0.4
"""Least time, s, between readings at two commanded poses: move, settle, dwell."""
SLOWEST, LONGEST = 1000.0, 1e5
"""Median time between two poses, and of the whole run, from which on it is no campaign in s."""
LATE, TIMES = 7200.0, 2.0
"""First time, s, and times the whole run, from which on it is a clock on the wall."""
HOUR_S, EVEN_S = 3600.0, 20.0
"""A whole hour, s, and how far apart other steps may be for a jump by it to tell."""
LEAST = 8
"""Fewest moves between poses that tell anything."""


def clock(run: Run) -> tuple[Run, list[Remark]]:
    """Read times in s; say where they tell nothing."""
    rows, gaps = _gaps(run)
    if gaps.size < LEAST:
        return run, []
    run, remarks = _from_the_start(run)
    if np.all(gaps >= 0.0) and np.any(gaps > 0.0):
        run, parted = _parts(run, rows, gaps)
        run, jumps = _jumped(run)
        remarks += [*parted, *jumps]
        gaps = _gaps(run)[1]
    usual = float(np.median(gaps))
    if np.ptp(run.time_s) == 0.0:
        return run, [*remarks, _standing(run)]
    if usual > SLOWEST and float(np.ptp(run.time_s)) > LONGEST:
        return _read_as(run, "ms", 1e-3, usual, remarks)
    if 0.0 < usual < FASTEST:
        for unit, factor in (("minutes", 60.0), ("hours", 3600.0), ("days", 86400.0)):
            if usual * factor > FASTEST:
                return _read_as(run, unit, factor, usual, remarks)
    return run, remarks


def _gaps(run: Run) -> tuple[IntArray, Array]:
    """Rows that were read at another commanded pose than the row before, and the time since, s."""
    rows = np.flatnonzero(run.measured)
    moved = np.any(np.diff(run.q[:, rows], axis=1) != 0.0, axis=0)
    return rows[1:][moved], np.asarray(np.diff(run.time_s[rows])[moved])


def _parts(run: Run, rows: IntArray, gaps: Array) -> tuple[Run, list[Remark]]:
    """Times that go on in another unit from some row on, or up to it."""
    known = np.flatnonzero(gaps > 0.0)
    logs = np.log(gaps[known])
    if known.size < 2 * LEAST:
        return run, []
    edges = np.arange(LEAST, known.size - LEAST + 1)
    sums = np.cumsum(logs)
    apart = sums[edges - 1] / edges - (sums[-1] - sums[edges - 1]) / (known.size - edges)
    at = int(edges[np.argmax(apart**2 * edges * (known.size - edges))])
    early, late = float(np.exp(np.median(logs[:at]))), float(np.exp(np.median(logs[at:])))
    fast, slow = min(early, late), max(early, late)
    if slow < 30.0 * fast or (fast > FASTEST and slow < SLOWEST):
        return run, []
    unit, factor = ("ms", 1e-3) if slow > SLOWEST else ("minutes", 60.0)
    if not 0.5 < (slow / fast) / max(factor, 1.0 / factor) < 2.0:
        return run, []
    row = int(rows[known[at]])
    after = (late < early) == (factor > 1.0)
    which = np.arange(run.line.size) >= row if after else np.arange(run.line.size) < row
    steps = np.diff(run.time_s, prepend=run.time_s[0]) * np.where(which, factor, 1.0)
    lines = ranges(run.line[which], run.line)
    return replace(run, time_s=run.time_s[0] + np.cumsum(steps)), [
        Remark(
            "time-unit",
            f"time_s looks like {unit} in {lines_in_words(lines)}",
            lines,
            f"Poses follow one another by {late if after else early:.3g} there, and by "
            f"{early if after else late:.3g} s elsewhere",
            f"Read as {unit} there",
            "Write time_s in s",
            True,
            run.source,
        )
    ]


def _jumped(run: Run) -> tuple[Run, list[Remark]]:
    """A clock that was put forward by a whole hour while rows follow one another evenly."""
    steps = np.diff(run.time_s)
    there = np.flatnonzero(steps > 0.0)
    for k in there:
        gap, others = float(steps[k]), steps[there[there != k]]
        hours = round((gap - float(np.median(others))) / HOUR_S) if others.size > LEAST else 0
        rest = gap - hours * HOUR_S
        if (
            hours < 1
            or np.ptp(others) > EVEN_S
            or not (others.min() - 1.0 < rest < others.max() + 1.0)
        ):
            continue
        row, usual = int(k) + 1, float(np.median(others))
        late = np.arange(run.line.size) >= row
        return replace(run, time_s=run.time_s - np.where(late, hours * HOUR_S, 0.0)), [
            Remark(
                "time-jump",
                f"time_s jumps by {hours} h to the second before line {run.line[row]}: the clock "
                "was set (summer time, time zone)",
                ranges(run.line[late], run.line),
                f"That step takes {gap:.6g} s, the others {usual:.3g} s and little else; a pause "
                "is no whole hour",
                "Taken back",
                f"Take {hours * HOUR_S:g} s from time_s from line {run.line[row]} on; if it was a "
                "pause, move it by a minute",
                True,
                run.source,
            )
        ]
    return run, []


def _standing(run: Run) -> Remark:
    return Remark(
        "time-stands",
        f"time_s is {run.time_s[0]:g} in all rows: when anything was read is not known",
        (),
        "The machine was commanded elsewhere between the readings, and that takes time",
        "Taken as it stands: nothing that depends on time is looked for",
        "Write the time of each reading, s from the start of the run",
        True,
        run.source,
    )


def _from_the_start(run: Run) -> tuple[Run, list[Remark]]:
    """Times of a clock on the wall, or since 1970, counted from the first row."""
    first, span = float(run.time_s[0]), float(np.ptp(run.time_s))
    if first < LATE or first < TIMES * span:
        return run, []
    return replace(run, time_s=run.time_s - first), [
        Remark(
            "time-zero",
            f"time_s begins at {first:.10g}: it is a time of day, or since 1970, not from the "
            "start of the run",
            (),
            f"The whole run takes {span:.4g}",
            "Counted from the first row",
            "Write time_s in s from the start of the run",
            True,
            run.source,
        )
    ]


def _read_as(
    run: Run, unit: str, factor: float, usual: float, before: list[Remark]
) -> tuple[Run, list[Remark]]:
    return replace(run, time_s=factor * run.time_s), [
        *before,
        Remark(
            "time-unit",
            f"time_s looks like {unit}: {usual:.3g} between two poses is {usual * factor:.3g} s",
            (),
            f"In s a move and a reading would take {usual:.3g} s",
            f"Read as {unit}",
            "Write time_s in s",
            True,
            run.source,
        ),
    ]
