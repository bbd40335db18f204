"""Products of two states, as formulas of the library: a small search over physics nobody named.

Every state carries its unit; the unit of a term's coefficient follows from what the term must be,
mm or rad. Channels are centred, so that a product is not what its first factor is already.
"""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

from calib.formulas.functions import POSE

CHANNEL_UNITS = {"_C": "K", "_kg": "kg", "_s": "s", "_mm": "mm", "_N": "N", "_rad": "rad"}
"""Unit of a channel by how its name ends; of others it is the channel's name."""


@dataclass(frozen=True)
class Product:
    """``text`` with the unknown as ``{a}``, its unit, and whether each actuator has its own."""

    text: str
    unit: str
    own: bool


@dataclass(frozen=True)
class _State:
    """A factor: its text, the powers of its units, whether it is each actuator's own."""

    text: str
    units: tuple[tuple[str, int], ...] = ()
    own: bool = True


def unit_of(wanted: str, *factors: Sequence[tuple[str, int]]) -> str:
    """Unit of a coefficient by which a product of ``factors`` becomes ``wanted``: mm/(N K)."""
    powers: Counter[str] = Counter({wanted: 1})
    for factor in factors:
        for unit, power in factor:
            powers[unit] -= power
    above = [_raised(unit, power) for unit, power in powers.items() if power > 0]
    below = [_raised(unit, -power) for unit, power in powers.items() if power < 0]
    if not below:
        return " ".join(above) or "1"
    under = below[0] if len(below) == 1 else f"({' '.join(below)})"
    return f"{' '.join(above) or '1'}/{under}"


def _raised(unit: str, power: int) -> str:
    return unit if power == 1 else f"{unit}^{power}"


def actuator_products(
    unit: str, channels: Sequence[tuple[str, str]], *, timed: bool
) -> Iterator[Product]:
    """Products of two states for actuators in ``unit`` (mm or rad).

    ``channels`` are (name, text of its centred value); ``timed`` whether time passes.
    """
    force = (("N", 1),) if unit == "mm" else (("N", 1), ("mm", 1))
    states = [
        _State("s", ((unit, 1),)),
        _State("direction"),
        _State("step", ((unit, 1),)),
        _State("force", force),
        _State("way", ((unit, 1),)),
        *(_State(text, ((_channel_unit(name), 1),), own=False) for name, text in channels),
        *(_State(name, _pose_unit(name), own=False) for name in POSE),
    ]
    if timed:
        states += [_State("t", (("s", 1),), own=False), _State("since", (("s", 1),))]
    for one in states:
        if one.own:
            yield Product(f"{{a}} * {one.text}", unit_of(unit, one.units), True)
        yield Product(
            f"{{a}} * {one.text} * {one.text}", unit_of(unit, one.units, one.units), one.own
        )
    for one, other in combinations(states, 2):
        # What is no actuator's own moves all of them alike, which frames and geometry mostly take.
        if one.own or other.own:
            text = f"{{a}} * {one.text} * {other.text}"
            yield Product(text, unit_of(unit, one.units, other.units), True)


def point_products(channels: Sequence[tuple[str, str]]) -> Iterator[Product]:
    """What displaces all points in one direction: pose, and pose times a channel."""
    for name in POSE:
        own = _pose_unit(name)
        yield Product(name, unit_of("mm", own), False)
        for channel, text in channels:
            unit = unit_of("mm", own, ((_channel_unit(channel), 1),))
            yield Product(f"{name} * {text}", unit, False)


def _pose_unit(name: str) -> tuple[tuple[str, int], ...]:
    return (("mm" if len(name) == len("pose_x") else "rad", 1),)


def _channel_unit(name: str) -> str:
    return next((unit for end, unit in CHANNEL_UNITS.items() if name.endswith(end)), name)
