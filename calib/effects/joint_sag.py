"""Joints of an arm give way under the links behind them, whose masses nobody has stated.

    extension_i = A_i (x_i . d) + B_i (y_i . d)

d is the direction of gravity, x_i and y_i are the two axes across joint i that turn with it (of
its frame x, y, z those that follow the joint's in cyclic order). The torque of what is rigid behind
a joint is of this form; A_i, B_i lump masses, centres and the joint's compliance, and what a spring
or a counterweight takes off again. With masses in the machine file (trait ``masses``) the torques
are known, and each joint has one number: ``leg-compliance``.
"""

import numpy as np

from calib.arrays import Array, BoolArray
from calib.effects.component import Effect, Signature, Situation, alone
from calib.effects.driven_chain import DrivenJoint, driven_joints, no_arm
from calib.effects.gravity_sag import under_load
from calib.effects.limb_frames import frames_along, turn_about
from calib.effects.link_weight import gravity_of, link_mass_kg
from calib.mechanism.description import Machine
from calib.mechanism.rigid import product
from calib.runs.stack import Rows
from calib.unknown import Unknown

LEVEL = 1e-3
"""Part of gravity across a joint below which the weight does not turn it."""
NEAR = 0.1
"""Part of the way from home to the limits at which it is asked which joints hang."""


class JointSag(Effect):
    """Two numbers for each joint that is not always upright."""

    id = "joint-sag"
    kind = "machine"
    says = "joints give way under the weight of the links behind them"
    depends = ("run",)

    def lacking(self, machine: Machine) -> str:
        """Joints one behind the other, masses not stated."""
        if link_mass_kg(machine) > 0.0:
            return "the masses of its links are stated: leg-compliance"
        return no_arm(machine)

    def told(self, rows: Rows) -> BoolArray:
        """Those of runs that say where gravity points."""
        return under_load(rows)

    def unavailable(self, rows: Rows) -> str:
        """Gravity must be stated, and turn some joint."""
        if all(run.header.load is None for run in rows.runs):
            return "run.toml has no [load], which says where gravity points"
        return "" if _hanging(rows) else "gravity turns no joint"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``joint-sag.q2.x``, ``.y`` ..., rad (in the unit of the actuator)."""
        axes = rows.machine.axes
        return tuple(
            Unknown(f"joint-sag.{axes[joint.actuator].name}.{way}", axis.unit, axis.usual_error)
            for joint in _hanging(rows)
            for axis in (axes[joint.actuator],)
            for way in "xy"
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each joint alone."""
        return alone(len(_hanging(rows)), 2)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Parts of gravity across each joint."""
        rows, joints = situation.rows, _hanging(situation.rows)
        down = _directions(gravity_of(rows))
        shape = np.zeros((2 * len(joints), *rows.extension.shape))
        for number, joint in enumerate(joints):
            x, y = _across(rows.machine, rows.extension, joint, down)
            shape[2 * number, joint.actuator] = x
            shape[2 * number + 1, joint.actuator] = y
        return Signature(extension=shape)


def _directions(gravity: Array) -> Array:
    """Unit vectors (3, N) along gravity; zero without any."""
    size = np.linalg.norm(gravity, axis=0)
    return np.asarray(gravity / np.where(size > 0.0, size, 1.0))


def _across(machine: Machine, s: Array, joint: DrivenJoint, down: Array) -> Array:
    """Parts (2, N) of ``down`` along the two axes across a joint that turn with it."""
    limb = machine.limbs[joint.limb]
    _, axes = frames_along(machine, limb, s, np.zeros((0, s.shape[1])))[joint.element]
    axis = limb.elements[joint.element].axis
    turned = product(axes, turn_about(axis, joint.factor * s[joint.actuator]))
    across = [np.sum(turned[:, (axis + k) % 3] * down, axis=0) for k in (1, 2)]
    return np.array(across)


def _hanging(rows: Rows) -> list[DrivenJoint]:
    """Joints that gravity can turn somewhere about home, of any run."""
    machine = rows.machine
    home = machine.home_q[:, None]
    near = machine.extension(np.hstack([home, home + NEAR * (machine.q_limits - home)]))
    loads = [run.header.load.gravity for run in rows.runs if run.header.load is not None]
    downs = [_directions(np.repeat(g[:, None], near.shape[1], axis=1)) for g in loads]
    return [
        joint
        for joint in driven_joints(machine)
        if any(np.any(np.abs(_across(machine, near, joint, down)) > LEVEL) for down in downs)
    ]


EFFECTS = (JointSag(),)
