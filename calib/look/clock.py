"""``time_s``: its unit, and clocks that stand still or count rows."""

from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.runs.record import Run
from calib.runs.remark import Remark

FASTEST = 0.4
"""Least time, s, between readings at two commanded poses: move, settle, dwell."""
SLOWEST, LONGEST = 1000.0, 1e5
"""Median time between two poses, and of the whole run, from which on it is no campaign in s."""
LATE, TIMES = 7200.0, 2.0
"""First time, s, and times the whole run, from which on it is a clock on the wall."""
LEAST = 8
"""Fewest moves between poses that tell anything."""


def clock(run: Run) -> tuple[Run, list[Remark]]:
    """Read times in s; say where they tell nothing."""
    gaps = _gaps(run)
    if gaps.size < LEAST:
        return run, []
    run, remarks = _from_the_start(run)
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


def _gaps(run: Run) -> Array:
    """Time between successive readings at different commanded poses, s."""
    rows = np.flatnonzero(run.measured)
    moved = np.any(np.diff(run.q[:, rows], axis=1) != 0.0, axis=0)
    return np.asarray(np.diff(run.time_s[rows])[moved])


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
