"""One limb of an over-constrained machine does not carry its constraint.

Zhang et al. 2018 (docs/papers.md) release one limb after the other; the machine file says which.
"""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation
from calib.mechanism.description import Machine
from calib.mechanism.rigid import Poses, small_rotation
from calib.mechanism.solve import begun_at, forward
from calib.mechanism.variants import closure_names, with_closure
from calib.runs.stack import Rows
from calib.unknown import Choice, Unknown


class Redundancy(Effect):
    """The constraint of one limb released: 1 is free, 0 is as stiff as the others."""

    id = "redundancy"
    kind = "machine"
    says = "one limb does not carry its constraint: play or a soft joint in it"

    def lacking(self, machine: Machine) -> str:
        """The machine file must name closures that release one limb."""
        if _released(machine):
            return ""
        return "its file names no closure that releases one limb ([closure.NAME] release)"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``redundancy.share`` and, searched, ``redundancy.limb``."""
        limbs = Choice(tuple((float(k), one.name) for k, one in enumerate(rows.machine.limbs, 1)))
        return (
            Unknown("redundancy.share", "1", 1.0),
            Unknown("redundancy.limb", "1", 1.0, sigma=1e-6, nonlinear=True, means=limbs),
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


EFFECTS = (Redundancy(),)
