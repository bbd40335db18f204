"""What grows with the force that the weight puts into each actuator.

The forces (torques where actuators turn) are those of ``gravity-sag``. An actuator that the weight
does not load wherever the machine goes (an upright axis, a level slide) is not asked.
"""

from functools import lru_cache

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.effects.component import Effect, Signature, Situation, alone, per_actuator
from calib.effects.gravity_sag import actuator_forces, under_load, weightless
from calib.mechanism.description import Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.rigid import cross
from calib.mechanism.solve import forward
from calib.runs.stack import Rows
from calib.unknown import Unknown

NEAR = 0.1
"""Part of the way from home to the limits at which it is asked what carries the weight."""
NOTHING = 1e-9


class PerForce(Effect):
    """One number for each actuator that carries a part of the weight."""

    kind = "machine"

    def unavailable(self, rows: Rows) -> str:
        """Without a weight, or where none of it rests on an actuator."""
        return weightless(rows) or ("" if loaded(rows).size else "no actuator carries the weight")

    def told(self, rows: Rows) -> BoolArray:
        """Those of runs with [load]."""
        return under_load(rows)

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``leg1`` ... under the effect's name, mm/N or rad/(N mm)."""
        axes = [rows.machine.axes[index] for index in loaded(rows)]
        return tuple(
            Unknown(f"{self.id}.{axis.name}", axis.compliance_unit, axis.compliance)
            for axis in axes
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each actuator alone."""
        return alone(loaded(rows).size)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """What :meth:`part` makes of the force in each actuator."""
        shape = per_actuator(self.part(situation.rows, actuator_forces(situation)))
        return Signature(extension=shape[loaded(situation.rows)])

    def part(self, rows: Rows, forces: Array) -> Array:
        """What one unit of the number adds to each actuator, of its forces in tension."""
        return forces


def loaded(rows: Rows) -> IntArray:
    """Actuators on which the weight of any run can rest, by index."""
    borne = np.zeros(len(rows.machine.actuators), dtype=bool)
    for run in rows.runs:
        if run.header.load is not None:
            borne |= _carrying(rows.machine, tuple(map(float, run.header.load.gravity)))
    return np.flatnonzero(borne)


@lru_cache(maxsize=64)
def _carrying(machine: Machine, gravity: tuple[float, ...]) -> BoolArray:
    """Whether a weight anywhere on the platform does work on each actuator, (n,).

    At home and on both sides of it: axes that are upright there alone are loaded elsewhere. Work
    on a weight at r is g . (v + omega x r), for some r not zero unless g . v and omega x g are.
    """
    home, limits = machine.home_q[:, None], machine.q_limits
    extension = machine.extension(np.hstack([home, home + NEAR * (limits - home)]))
    near = forward(machine, extension)
    twists = pose_jacobians(machine, near).actuators[:, :, near.converged]
    down = np.array(gravity) / max(float(np.linalg.norm(gravity)), 1e-300)
    along = np.einsum("icm,c->im", twists[:, :3], down) / machine.size
    across = cross(np.moveaxis(twists[:, 3:], 0, 1), down[:, None, None])
    work = np.maximum(np.abs(along), np.abs(across).max(axis=0))
    largest = np.linalg.norm(twists[:, :3], axis=1) / machine.size
    largest += np.linalg.norm(twists[:, 3:], axis=1)
    return np.asarray((work > NOTHING * largest).any(axis=1))
