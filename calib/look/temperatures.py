"""Columns of temperatures: their unit, value by value, and what a sensor sends when it has none."""

from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, BoolArray
from calib.runs.record import Run
from calib.runs.remark import Remark, lines_in_words, ranges

SENTINELS = (
    -127.0, 85.0, 999.0, -999.0, 9999.0, -9999.0, 999.9, -999.9, -273.15, 32767.0, 3276.7, 327.67,
    65535.0, 6553.5, 655.35, -32768.0, -3276.8, -327.68, 850.0, -200.0,
)  # fmt: skip
"""What sensors and converters send instead of a temperature, exactly; deg C."""
ROOM = (-40.0, 60.0)
"""Temperatures, deg C, at which a machine is measured."""
LIKELY = (5.0, 45.0)
"""Those at which it is measured where another unit is in question."""
APART = 15.0
"""Least distance, K, of a sentinel or a zero from the other values."""
JUMP = 3.0
"""Step, K, that no structure makes between two readings."""
SIDE = 5
"""Values on either side of a step that tell its size."""
AT_ONCE = 300.0
"""Time, s, between two readings within which a structure cannot warm by that."""
STUCK = 1e-6
"""Probability, from the changes seen before, that a sensor stands still for so long."""


@dataclass(frozen=True)
class _Unit:
    """A unit other than deg C: the values that are taken for it, and how they are read."""

    name: str
    looks_like: str
    low: float
    high: float
    factor: float
    offset: float
    whole: bool = False
    jump: float = np.inf
    """Largest step from row to row, in its own counts, that a room makes."""


_UNITS = (
    _Unit("temperature-in-tenths", "tenths of a degree", 61, 450, 0.1, 0.0, True, 20.0),
    _Unit("temperature-in-hundredths", "hundredths of a degree", 451, 4500, 0.01, 0.0, True, 200.0),
    _Unit(
        "temperature-in-thousandths", "thousandths of a degree",
        4501, 45000, 0.001, 0.0, True, 2000.0,
    ),
    _Unit("temperature-in-kelvin", "kelvin", 200.0, 400.0, 1.0, -273.15),
    _Unit("temperature-in-fahrenheit", "degrees Fahrenheit", 60.0, 110.0, 5 / 9, -160 / 9),
    _Unit(
        "temperature-sign", "degrees of the wrong sign", -45.0, -12.0, -1.0, 0.0
    ),
)  # fmt: skip


def temperatures(run: Run) -> tuple[Run, list[Remark]]:
    """Read every column of temperatures (``*_C``) in deg C; what is none becomes nan."""
    channels, remarks = dict(run.channels), []
    for name in channels:
        if not name.endswith("_C"):
            continue
        values = np.array(channels[name])
        for look in (_counted, _unit, _none_at_all, _sentinels, _no_room, _jumped, _stuck):
            values, remark = look(run, name, values)
            if remark is not None:
                remarks.append(remark)
        channels[name] = values
    return (replace(run, channels=channels), remarks) if remarks else (run, [])


def _unit(run: Run, name: str, values: Array) -> tuple[Array, Remark | None]:
    """Values that are no room in deg C, and are one in another unit."""
    for unit in _UNITS:
        inside = np.isfinite(values) & (values >= unit.low) & (values <= unit.high)
        inside &= ~np.isin(values, SENTINELS)
        if inside.sum() < 2:
            continue
        if unit.whole and not _whole(values[inside]):
            continue
        read = values * unit.factor + unit.offset
        if not LIKELY[0] < float(np.median(read[inside])) < LIKELY[1]:
            continue
        if _jumps(values[inside]) > unit.jump:
            continue
        seen = float(np.median(values[inside]))
        lines = _lines(run, inside)
        return np.where(inside, read, values), Remark(
            unit.name,
            f"{name} looks like {unit.looks_like}: {seen:.4g} is "
            f"{seen * unit.factor + unit.offset:.4g} deg C",
            () if inside.all() else lines,
            f"{int(inside.sum())} values between {values[inside].min():.4g} and "
            f"{values[inside].max():.4g} are no room in deg C",
            f"Read as {unit.looks_like}",
            f"Write {name} in deg C",
            True,
            run.source,
        )
    return values, None


def _counted(run: Run, name: str, values: Array) -> tuple[Array, Remark | None]:
    """A column that goes on by one number from row to row: it was filled down."""
    finite = values[np.isfinite(values)]
    steps = np.diff(finite)
    if finite.size < 2 * SIDE or steps[0] == 0.0 or np.ptp(steps) > 1e-9 * abs(steps[0]):
        return values, None
    return np.full_like(values, np.nan), Remark(
        "no-temperature",
        f"{name} goes on by {steps[0]:g} from row to row: it was filled down, not measured",
        (),
        "The steps from row to row are equal to the last digit",
        "Left empty",
        "Leave the column empty where there is no value; see the sensor",
        True,
        run.source,
    )


def _whole(values: Array) -> bool:
    return bool(np.all(values == np.round(values)))


def _jumps(values: Array) -> float:
    return float(np.abs(np.diff(values)).max(initial=0.0))


def _none_at_all(run: Run, name: str, values: Array) -> tuple[Array, Remark | None]:
    """A column that holds one number which stands for no sensor, from end to end."""
    finite = values[np.isfinite(values)]
    if finite.size < 2 or np.ptp(finite) > 0.0 or finite[0] not in (*SENTINELS, 0.0):
        return values, None
    return np.full_like(values, np.nan), Remark(
        "no-temperature",
        f"{name} is {finite[0]:g} in all rows: there was no sensor",
        (),
        "No sensor reads the same number, and that one, from end to end",
        "Left empty",
        "Leave the column empty where there is no value; see the sensor",
        True,
        run.source,
    )


def _sentinels(run: Run, name: str, values: Array) -> tuple[Array, Remark | None]:
    """Numbers that stand for a missing sensor, or exactly zero, far from all others."""
    finite = np.isfinite(values)
    marked = finite & np.isin(values, (*SENTINELS, 0.0))
    rest = values[finite & ~marked]
    if not marked.any() or rest.size == 0:
        return values, None
    marked &= np.abs(values - np.median(rest)) > APART
    if not marked.any():
        return values, None
    lines = _lines(run, marked)
    found = ", ".join(f"{value:g}" for value in np.unique(values[marked]))
    return np.where(marked, np.nan, values), Remark(
        "no-temperature",
        f"{name} is {found} in {lines_in_words(lines)}: the sensor was not read",
        lines,
        f"The other values are about {np.median(rest):.3g} deg C",
        "Left empty",
        "Leave the column empty where there is no value; see the sensor",
        True,
        run.source,
    )


def _no_room(run: Run, name: str, values: Array) -> tuple[Array, Remark | None]:
    """Whatever else is outside, while most values are a room."""
    finite = np.isfinite(values)
    out = finite & ((values < ROOM[0]) | (values > ROOM[1]))
    if not out.any() or out.sum() > 0.5 * finite.sum():
        return values, None
    lines = _lines(run, out)
    return np.where(out, np.nan, values), Remark(
        "no-temperature",
        f"{name} is no room temperature in {lines_in_words(lines)}",
        lines,
        f"It is between {values[out].min():.4g} and {values[out].max():.4g} there",
        "Left empty",
        "Leave the column empty where there is no value; see the sensor",
        True,
        run.source,
    )


def _jumped(run: Run, name: str, values: Array) -> tuple[Array, Remark | None]:
    """A structure that is some kelvin warmer from one row to the next: another sensor."""
    at = np.flatnonzero(np.isfinite(values) & (run.measured | np.array([not n for n in run.nest])))
    if at.size < 2 * SIDE or name.startswith("air"):
        return values, None
    steps = np.abs(np.diff(values[at]))
    k = int(np.argmax(steps))
    others = np.delete(steps, k)
    before, after = values[at[max(0, k + 1 - SIDE) : k + 1]], values[at[k + 1 : k + 1 + SIDE]]
    change = float(np.median(after) - np.median(before))
    slow = float(run.time_s[at[k + 1]] - run.time_s[at[k]]) > AT_ONCE
    if slow or min(before.size, after.size) < SIDE or abs(change) < JUMP:
        return values, None
    if steps[k] < 0.8 * JUMP or steps[k] < 8.0 * others.max():
        return values, None
    line = int(run.line[at[k + 1]])
    return values, Remark(
        "temperature-jump",
        f"{name} jumps by {change:+.2g} K in line {line} and stays there: another sensor, or "
        "another place of it",
        ranges(run.line[at[k + 1 :]], run.line),
        f"No other step is larger than {others.max():.2g} K; a structure does not warm so fast",
        "Taken as it stands: what is found for heat may be wrong",
        f"Correct {name} from line {line} on by that step, or leave it empty there",
        False,
        run.source,
    )


def _stuck(run: Run, name: str, values: Array) -> tuple[Array, Remark | None]:
    """A sensor that went on changing, and at some row stopped, for good or for a while."""
    new = np.concatenate([[True], np.diff(run.time_s) > 0])
    at = np.flatnonzero(new & np.isfinite(values))
    if at.size < 20:
        return values, None
    changes = np.diff(values[at]) != 0.0
    last, still = _longest_standing(changes)
    # A sensor may creep to a standstill: the changes beside it count, not those of the warm-up.
    window = max(still, 8)
    before = changes[max(0, last - window) : last]
    beside = np.concatenate([before, changes[last + still : last + still + window]])
    if before.size < 8 or still < 8 or not beside.any():
        return values, None
    rate = float(np.mean(beside))
    if still * np.log1p(-min(rate, 0.999)) + np.log(changes.size) > np.log(STUCK):
        return values, None
    # The first of the equal values was read; what follows repeats it.
    end = at[last + still + 1] if last + still + 1 < at.size else values.size
    out = np.arange(values.size) > at[last]
    out &= (np.arange(values.size) < end) & np.isfinite(values)
    out &= run.time_s > run.time_s[at[last]]
    lines = _lines(run, out)
    good = "from line" if end == values.size else "in lines"
    until = " on" if end == values.size else f" to {lines[-1][1]}"
    return np.where(out, np.nan, values), Remark(
        "temperature-stuck",
        f"{name} no longer changes {good} {lines[0][0]}{until} ({values[at[last]]:g} deg C)",
        lines,
        f"Beside that it changed in {100 * rate:.0f} % of the readings",
        "Left empty there",
        "See the sensor and its link; measure again if heat matters",
        True,
        run.source,
    )


def _longest_standing(changes: BoolArray) -> tuple[int, int]:
    """Where the longest row of no change begins, and how long it is."""
    edges = np.flatnonzero(np.concatenate([[True], changes, [True]]))
    lengths = np.diff(edges) - 1
    k = int(np.argmax(lengths))
    return int(edges[k]), int(lengths[k])


def _lines(run: Run, which: BoolArray) -> tuple[tuple[int, int], ...]:
    return ranges(run.line[which], run.line)
