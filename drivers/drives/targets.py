"""What may be commanded: actuator values and trajectories, checked before anything moves."""

import math
from collections.abc import Sequence
from itertools import pairwise

from drivers.drives.axis import Axis
from drivers.drives.bus import DriveBus
from drivers.drives.way import Counts, Table
from drivers.errors import Refused

SPARE = 1.001
"""A trajectory may pass speed and acceleration by this much: it was rounded somewhere."""


def in_counts(bus: DriveBus, q: Sequence[float]) -> list[int]:
    """The drives' positions at ``q``; raises Refused for one outside its limits."""
    if len(q) != len(bus.axes) or not all(map(math.isfinite, q)):
        raise Refused(
            f"{len(bus.axes)} finite values are wanted, got {q}",
            device="drives",
            remedy="Nothing was commanded.",
        )
    counts = []
    for value, axis in zip(q, bus.axes, strict=True):
        low, high = bus.soft_limits(axis)
        target = axis.to_counts(value)
        if not low <= target <= high:
            lowest, highest = sorted((axis.to_q(low), axis.to_q(high)))
            raise Refused(
                f"{axis.name} = {value:.6g} {axis.unit} is outside {lowest:.6g} to {highest:.6g}",
                device=f"drive {axis.name} (node {axis.node})",
                remedy="Nothing was commanded. Choose values within the limits; they are the "
                "narrower of the site file's and those that 0x607D held at connect.",
            )
        counts.append(target)
    return counts


def table_of(bus: DriveBus, rows: Sequence[Sequence[float]], every_s: float, held: Counts) -> Table:
    """The way along ``rows`` of q, ``every_s`` machine seconds apart, from where all are held.

    Raises Refused, with the number of the row, for what is outside limits, speed or acceleration;
    the machine stands before the first row and after the last.
    """
    if not len(rows) or not (math.isfinite(every_s) and every_s > 0.0):
        raise _refused(f"{len(rows)} rows every {every_s} s are no trajectory", "")
    counts = []
    for number, row in enumerate(rows, start=1):
        try:
            counts.append(tuple(in_counts(bus, row)))
        except Refused as error:
            what = f"row {number}: {error.what}"
            raise Refused(what, device=error.device, remedy=error.remedy) from error
    for axis, at, wanted in zip(bus.axes, held, counts[0], strict=True):
        if abs(at - wanted) > bus.window(axis):
            raise _refused(
                f"it begins at {axis.name} = {axis.to_q(wanted):.6g} {axis.unit}, the machine is "
                f"held at {axis.to_q(at):.6g}",
                "Move to its first row before.",
            )
    for n, axis in enumerate(bus.axes):
        values = [float(row[n]) for row in rows]
        _must_be_slow([0.0, *_steps(values, every_s), 0.0], every_s, axis)
    return Table((held, *counts[1:]), every_s)


def _steps(values: list[float], every_s: float) -> list[float]:
    return [(b - a) / every_s for a, b in pairwise(values)]


def _must_be_slow(speeds: list[float], every_s: float, axis: Axis) -> None:
    for what, unit, found, most in (
        ("speed", "s", speeds, axis.speed),
        ("acceleration", "s^2", _steps(speeds, every_s), axis.acceleration),
    ):
        worst = max(range(len(found)), key=lambda row: abs(found[row]))
        if abs(found[worst]) > SPARE * most:
            raise _refused(
                f"row {worst + 1}: {axis.name} has {what} {abs(found[worst]):.4g} "
                f"{axis.unit}/{unit}, allowed are {most:g}",
                f"Let it take longer; {what} stands under [controller].",
            )


def _refused(what: str, remedy: str) -> Refused:
    return Refused(what, device="drives", remedy=f"Nothing was commanded. {remedy}".strip())
