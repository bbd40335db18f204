"""What the site file says of drives, in the form in which the driver uses it."""

import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from drivers.canopen.bus_address import BusAddress
from drivers.drives.axis import Axis
from drivers.kind import Surroundings

REFERENCED_WORDS = ("homing", "always")
_BIT = re.compile(r"0x([0-9A-Fa-f]{4})(?::(\d+))? +bit +(\d+)")


@dataclass(frozen=True)
class Referenced:
    """How a drive says that it knows its reference.

    A bit of an object, or (``index`` 0) not at all: then it counts as known from this program's
    homing on, or ``always``, where encoders are absolute.
    """

    always: bool = False
    index: int = 0
    sub: int = 0
    bit: int = 0

    @classmethod
    def parse(cls, text: str) -> "Referenced | None":
        """Read ``homing``, ``always`` or ``0x6041 bit 15``; None if it is none of these."""
        if text in REFERENCED_WORDS:
            return cls(always=text == "always")
        match = _BIT.fullmatch(text.strip())
        if match is None:
            return None
        return cls(False, int(match[1], 16), int(match[2] or 0), int(match[3]))


@dataclass(frozen=True)
class Plan:
    """All that :func:`drivers.drives.motors.connect` needs.

    ``window``: in the actuators' units, 0 for the drives' own. ``time_scale``: machine seconds per
    wall second. Everything else as :data:`drivers.drives.kind.KIND` declares it.
    """

    address: BusAddress
    axes: tuple[Axis, ...]
    feed_unit: float = 0.0
    believe: bool = True
    window: float = 0.0
    referenced: Referenced = Referenced()
    quick_stop: int = 2
    on_silence: int = 1
    cyclic: bool = False
    sync_s: float = 0.01
    serial: str = ""
    time_scale: float = 1.0


def plan_of(around: Surroundings) -> Plan:
    """Return the plan of a site file's settings."""
    settings = around.settings
    address = BusAddress(
        settings["interface"],
        settings["channel"],
        settings["bitrate"] or None,
        heartbeat_s=settings["heartbeat_s"],
        silence_s=settings["silence_s"],
        more=settings["can"],
    )
    referenced = Referenced.parse(settings["referenced"])
    assert referenced is not None  # the kind has checked it
    return Plan(
        address=address,
        axes=_axes(around),
        feed_unit=settings["feed_unit"],
        believe=settings["factors"] == "believe",
        window=settings["window"],
        referenced=referenced,
        quick_stop=settings["quick_stop"],
        on_silence=settings["on_silence"],
        cyclic=settings["mode"] == "cyclic",
        sync_s=settings["sync_s"],
        serial=around.serial,
        time_scale=around.time_scale,
    )


def _axes(around: Surroundings) -> tuple[Axis, ...]:
    settings, facts = around.settings, around.actuators

    def each(name: str, otherwise: list[Any]) -> list[Any]:
        return list(settings[name]) or otherwise

    nothing = [None] * len(facts)
    nodes = each("nodes", list(range(1, len(facts) + 1)))
    files = list(settings["eds"])
    files = files * len(facts) if len(files) == 1 else files
    lists = zip(
        facts,
        nodes,
        files,
        each("counts_per_unit", nothing),
        each("sign", [1.0] * len(facts)),
        each("offset", [fact.home for fact in facts]),
        each("homing_method", nothing),
        each("lower", [fact.limits[0] for fact in facts]),
        each("upper", [fact.limits[1] for fact in facts]),
        settings["speed"],
        settings["acceleration"],
        each("speed_counts", nothing),
        each("acceleration_counts", nothing),
        strict=True,
    )
    return tuple(
        Axis(
            name=fact.name,
            unit=fact.unit,
            node=int(node),
            eds=Path(eds),
            counts=counts,
            sign=sign,
            offset=offset,
            homing_method=None if method is None else int(method),
            limits=(max(lower, fact.limits[0]), min(upper, fact.limits[1])),
            speed=speed,
            acceleration=acceleration,
            speed_counts=speed_counts,
            acceleration_counts=acceleration_counts,
        )
        for (
            fact, node, eds, counts, sign, offset, method, lower, upper, speed, acceleration,
            speed_counts, acceleration_counts,
        ) in lists
    )  # fmt: skip
