"""Effects of over-constrained tracking mechanisms (Zhang et al. 2018; docs/papers.md)."""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, Unknown
from calib.effects.thermal_growth import REFERENCE_C, ThermalGrowth
from calib.mechanism.description import Limb, Machine
from calib.mechanism.rigid import Poses, small_rotation
from calib.mechanism.solve import begun_at, forward
from calib.mechanism.variants import closure_names, with_closure
from calib.runs.stack import Rows

LINKS = {"rsr": ("1dx2", "1dy2", "4dx5", "4dz5"), "ss": ("3dz4",)}
"""Error sources along the links of a limb: both links of an RSR limb, the rod of the SS limb."""


def _links(machine: Machine) -> dict[str, float]:
    """Error sources along links, and the link's nominal component along each, mm."""
    names = {parameter.name for parameter in machine.parameters}
    found: dict[str, float] = {}
    for limb in machine.limbs:
        kind = "rsr" if f"{limb.name}.4dz5" in names else "ss"
        for part in LINKS[kind]:
            if f"{limb.name}.{part}" in names:
                found[f"{limb.name}.{part}"] = _along(machine, limb, f"{limb.name}.{part}")
    return found


def _along(machine: Machine, limb: Limb, name: str) -> float:
    """Sum of the constant translations beside a parameter, along its axis, with no turn between."""
    index = machine.index(name)
    at = next(
        place
        for place, element in enumerate(limb.elements)
        if any(term.kind == "parameter" and term.index == index for term in element.terms)
    )
    first = last = at
    while first > 0 and not limb.elements[first - 1].turns:
        first -= 1
    while last + 1 < len(limb.elements) and not limb.elements[last + 1].turns:
        last += 1
    axis = limb.elements[at].axis
    return sum(e.constant for e in limb.elements[first : last + 1] if e.axis == axis)


class LinkGrowth(ThermalGrowth):
    """All links grow; base and platform radius do not."""

    says = "the links grow with the temperature of the structure"

    def applies(self, machine: Machine) -> bool:
        """Where limbs of two links are described with error sources along them."""
        return any(parameter.name.endswith(".4dz5") for parameter in machine.parameters)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Every link along itself."""
        warming = situation.rows.channels["structure_temp_C"] - REFERENCE_C
        total = np.zeros((6, situation.rows.count))
        for name, length in _links(situation.machine).items():
            total += length * situation.error_twists(name)
        return Signature(twist=(warming * total)[None])


class Redundancy(Effect):
    """The constraint of one limb released: 1 is free, 0 is as stiff as the others."""

    id = "redundancy"
    kind = "machine"
    says = "one limb does not carry its constraint: play or a soft joint in it"

    def applies(self, machine: Machine) -> bool:
        """Where the machine file names closures that release one limb (D1 .. D4)."""
        return bool(machine.actuators) and bool(_released(machine))

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``redundancy.share`` and, searched, ``redundancy.limb``."""
        return (
            Unknown("redundancy.share", "1", 1.0),
            Unknown("redundancy.limb", "1", 1.0, sigma=1e-6, nonlinear=True),
        )

    def trials(self, rows: Rows) -> Iterator[tuple[float, ...]]:
        """Every limb whose constraint can be dropped."""
        for number in _released(rows.machine):
            yield (float(number),)

    def closure(self, machine: Machine, values: Array) -> Machine:
        """The machine without the constraint: what is linear about it is then its share."""
        return _without(machine, round(float(values[1])))

    def rest(self, rows: Rows) -> Array:
        """A share of one is what the released closure does."""
        return np.array([1.0, 0.0])

    def signature(self, situation: Situation, values: Array) -> Signature:
        """From the pose with all constraints to the pose without one, same parameters."""
        machine = situation.machine
        tight = _closed_as(machine, situation)
        loose = _closed_as(_without(machine, round(float(values[1]))), situation)
        turned = small_rotation(tight.rotation, loose.rotation)
        twist = np.concatenate([loose.position - tight.position, turned])[:, situation.state_of]
        return Signature(twist=np.stack([twist, np.zeros_like(twist)]))


def _closed_as(machine: Machine, situation: Situation) -> Poses:
    """Where another closure of the machine holds the platform, beginning at where it is now.

    Released from home a limb may close in another assembly.
    """
    closed = situation.closed
    if situation.closing is machine:
        return closed.poses
    start = begun_at(machine, closed)
    return forward(machine, closed.extension, situation.parameters, start).poses


@lru_cache(maxsize=16)
def _without(machine: Machine, limb: int) -> Machine:
    """The machine with the constraint of one limb dropped."""
    return with_closure(machine, _released(machine)[limb])


def _released(machine: Machine) -> dict[int, str]:
    """Closures that release one limb, by the limb's number."""
    found = {}
    table = machine.extra.get("closure", {})
    for name in closure_names(machine):
        entry = table.get(name) if isinstance(table, dict) else None
        limbs = entry.get("release", []) if isinstance(entry, dict) else []
        if len(limbs) == 1:
            numbers = [k for k, limb in enumerate(machine.limbs, 1) if limb.name == limbs[0]]
            found[numbers[0]] = name
    return found


EFFECTS = (LinkGrowth(), Redundancy())
