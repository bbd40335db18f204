"""Columns of temperatures: their unit, value by value, and what a sensor sends when it has none."""

from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, BoolArray
from calib.runs.record import Run
from calib.runs.remark import Remark, lines_in_words, ranges

SENTINELS = (-127.0, 85.0, 999.0, -999.0, 9999.0, -9999.0, 999.9, -999.9, -273.15, 32767.0)
"""What sensors and converters send instead of a temperature, exactly; deg C."""
ROOM = (-40.0, 60.0)
"""Temperatures, deg C, at which a machine is measured."""
LIKELY = (5.0, 45.0)
"""Those at which it is measured where another unit is in question."""
APART = 15.0
"""Least distance, K, of a sentinel or a zero from the other values."""
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


_UNITS = (
    _Unit("temperature-in-tenths", "tenths of a degree", 61.0, 450.0, 0.1, 0.0, whole=True),
    _Unit("temperature-in-hundredths", "hundredths of a degree", 451.0, 4500.0, 0.01, 0.0, True),
    _Unit("temperature-in-kelvin", "kelvin", 200.0, 400.0, 1.0, -273.15),
    _Unit("temperature-in-fahrenheit", "degrees Fahrenheit", 60.0, 110.0, 5 / 9, -160 / 9),
)


def temperatures(run: Run) -> tuple[Run, list[Remark]]:
    """Read every column of temperatures (``*_C``) in deg C; what is none becomes nan."""
    channels, remarks = dict(run.channels), []
    for name in channels:
        if not name.endswith("_C"):
            continue
        values = np.array(channels[name])
        for look in (_unit, _sentinels, _no_room, _stuck):
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
        if unit.whole and _jumps(values[inside]) > 20.0:
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


def _whole(values: Array) -> bool:
    return bool(np.all(values == np.round(values)))


def _jumps(values: Array) -> float:
    return float(np.abs(np.diff(values)).max(initial=0.0))


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


def _stuck(run: Run, name: str, values: Array) -> tuple[Array, Remark | None]:
    """A sensor that went on changing, and at some row stopped for good."""
    new = np.concatenate([[True], np.diff(run.time_s) > 0])
    at = np.flatnonzero(new & np.isfinite(values))
    if at.size < 20:
        return values, None
    changes = np.diff(values[at]) != 0.0
    last = int(np.flatnonzero(changes)[-1]) + 1 if changes.any() else 0
    before, still = last, changes.size - last
    if before < 8 or still < 8:
        return values, None
    # A sensor may creep to a standstill: its late changes count, not those of the warm-up.
    rate = float(np.mean(changes[max(0, before - max(still, 8)) : before]))
    if still * np.log1p(-min(rate, 0.999)) > np.log(STUCK):
        return values, None
    # The first of the equal values was read; what follows repeats it.
    out = np.zeros(values.size, dtype=bool)
    out[at[last] + 1 :] = True
    out &= np.isfinite(values) & (run.time_s > run.time_s[at[last]])
    lines = _lines(run, out)
    return np.where(out, np.nan, values), Remark(
        "temperature-stuck",
        f"{name} no longer changes from line {lines[0][0]} on ({values[at[last]]:g} deg C)",
        lines,
        f"Until then it changed in {100 * rate:.0f} % of the readings",
        "Left empty from there on",
        "See the sensor and its link; measure again if heat matters",
        True,
        run.source,
    )


def _lines(run: Run, which: BoolArray) -> tuple[tuple[int, int], ...]:
    return ranges(run.line[which], run.line)
