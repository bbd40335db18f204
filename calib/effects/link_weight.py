"""What the links of an arm weigh in its joints, by virtual work: F_i = sum m_k g . dr_k/ds_i.

For chains whose joints are all driven, with the masses that their file states (trait ``masses``);
nominal geometry, as a weight needs no better.
"""

from functools import lru_cache

import numpy as np

from calib.arrays import Array
from calib.effects.limb_frames import frames_along
from calib.mechanism.description import Limb, Machine
from calib.mechanism.rigid import cross, rotate
from calib.runs.stack import Rows


@lru_cache(maxsize=64)
def link_mass_kg(machine: Machine) -> float:
    """Mass of all links that have one, kg."""
    return sum(mass.kg for limb in machine.limbs for mass in limb.traits.masses)


def gravity_of(rows: Rows) -> Array:
    """Gravity (3, N) of the run of each reading, m/s^2; none where its run states no load."""
    loads = [run.header.load for run in rows.runs]
    each = [np.zeros(3) if load is None else load.gravity for load in loads]
    return np.array(each).T[:, rows.run]


def link_forces(rows: Rows) -> Array:
    """Force (N) or torque (N mm) that the links' weight puts into each actuator, (n, N)."""
    machine = rows.machine
    forces = np.zeros((len(machine.actuators), rows.count))
    if link_mass_kg(machine) > 0.0:
        gravity = gravity_of(rows)
        for limb in machine.limbs:
            _add(machine, limb, rows.extension, gravity, forces)
    return forces


def _add(machine: Machine, limb: Limb, extension: Array, gravity: Array, forces: Array) -> None:
    """Add what the masses of one chain do to each actuator before them."""
    frames = frames_along(machine, limb, extension, np.zeros((0, extension.shape[1])))
    for mass in limb.traits.masses:
        origin, axes = frames[mass.element + 1]
        place = origin + rotate(axes, np.array(mass.centre)[:, None])
        before = limb.elements[: mass.element + 1]
        for element, (start, turned) in zip(before, frames, strict=False):
            along = turned[:, element.axis]
            moved = cross(along, place - start) if element.turns else along
            for term in element.terms:
                if term.kind == "actuator":
                    work = np.sum(gravity * moved, axis=0)
                    forces[term.index] += term.factor * mass.kg * work
