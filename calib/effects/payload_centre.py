"""The payload's centre of mass is not where [load] says: its weight has a moment more.

    extension_i = w_i . M,   M = (R p) x m g,   p = c d

d is how far the centre is off, platform frame; w_i the turn of the platform per unit of extension
i; c the compliance that ``gravity-sag`` or ``leg-compliance`` has found, beside which alone this
is asked: readings show the product p, and d is p / c. Rods that are springs give way as the
closure has it.
"""

from functools import lru_cache

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.effects.component import Effect, Signature, Situation, alone
from calib.effects.gravity_sag import given_way, spring_compliance, under_load, weightless
from calib.mechanism.axes import Axis
from calib.mechanism.description import Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.rigid import cross
from calib.mechanism.solve import forward
from calib.runs.stack import Rows
from calib.unknown import Unknown

NEAR = 0.1
"""Part of an actuator's way by which it is moved to see what a moment would do."""
NOTHING = 1e-6
USUAL_MM = 10.0
UNITS = {"mm/N": "mm^2/N", "rad/(N mm)": "rad/N"}
"""Unit of a compliance times mm."""


class PayloadCentre(Effect):
    """How far the payload's centre is off along each axis of the platform."""

    id = "payload-centre"
    kind = "machine"
    says = "the payload's centre of mass is not where [load] says it is"
    channels = ("payload_kg",)
    depends = ("run", "payload_kg")
    beside = ("gravity-sag", "leg-compliance")

    def lacking(self, machine: Machine) -> str:
        """A moment must reach what yields."""
        if spring_compliance(machine):
            return ""
        _, turns = _near(machine)
        felt = np.abs(turns).max() * machine.size > NOTHING
        return "" if felt else "its platform never turns: no moment of a weight reaches an actuator"

    def unavailable(self, rows: Rows) -> str:
        """Without a payload."""
        carried = rows.channels.get("payload_kg", np.zeros(rows.count))
        here = rows.on_platform & under_load(rows)
        bare = "" if np.nan_to_num(carried[here]).any() else "no payload was on the platform"
        return super().unavailable(rows) or weightless(rows) or bare

    def told(self, rows: Rows) -> BoolArray:
        """Those of runs with [load]."""
        return under_load(rows)

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``payload-centre.x`` .. in the platform frame, mm^2/N or rad/N."""
        axis = _yielding(rows.machine)[0]
        size = USUAL_MM * axis.compliance
        unit = UNITS[axis.compliance_unit]
        return tuple(Unknown(f"payload-centre.{'xyz'[k]}", unit, size) for k in _shown(rows))

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Along each axis alone."""
        return alone(len(_shown(rows)))

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Moments of the payload's weight, through what yields by 1 a unit of it."""
        rows = situation.rows
        moments = _moments(rows, situation.rotation, _shown(rows))
        spring = spring_compliance(situation.machine)
        if spring:
            none = np.zeros((3, rows.count))
            twists = [given_way(situation, none, moment) / spring for moment in moments]
            return Signature(twist=np.array(twists))
        own = _yielding(situation.machine)[1]
        shape = np.zeros((len(moments), len(rows.machine.actuators), rows.count))
        shape[:, own] = np.einsum("icn,kcn->kin", situation.actuator_twists[own, 3:], moments)
        return Signature(extension=shape)


def _moments(rows: Rows, rotation: Array, axes: tuple[int, ...]) -> Array:
    """Moment (k, 3, N) in N mm of the payload's weight at 1 mm along axes of the platform."""
    gravity = np.zeros((3, rows.count))
    for index, run in enumerate(rows.runs):
        if run.header.load is not None:
            gravity[:, rows.run == index] = run.header.load.gravity[:, None]
    weight = np.nan_to_num(rows.channels["payload_kg"]) * gravity
    return np.array([cross(rotation[:, k], weight) for k in axes])


def _yielding(machine: Machine) -> tuple[Axis, IntArray]:
    """Those that give way, and the first of them: where some slide and some turn, the latter."""
    own = list(machine.axes_by_unit.values())[-1]
    return machine.axes[own[0]], own


def _shown(rows: Rows) -> tuple[int, ...]:
    """Axes of the platform along which an offset moves any reading under the runs' gravity."""
    loads = [run.header.load for run in rows.runs if run.header.load is not None]
    each = [_felt(rows.machine, tuple(map(float, load.gravity))) for load in loads]
    return tuple(sorted(set().union(*each)))


@lru_cache(maxsize=64)
def _felt(machine: Machine, gravity: tuple[float, ...]) -> tuple[int, ...]:
    """The same for one gravity, at home and with each actuator moved a little."""
    rotation, turns = _near(machine)
    down = np.array(gravity) / max(float(np.linalg.norm(gravity)), 1e-300)
    felt = []
    for k in range(3):
        moment = cross(rotation[:, k], np.tile(down[:, None], (1, rotation.shape[2])))
        work = np.einsum("icm,cm->im", turns, moment) * machine.size
        if np.abs(moment if spring_compliance(machine) else work).max() > NOTHING:
            felt.append(k)
    return tuple(felt)


@lru_cache(maxsize=64)
def _near(machine: Machine) -> tuple[Array, Array]:
    """Axes (3, 3, M) of the platform, and its turn (n, 3, M) by each extension, near home."""
    home, limits = machine.home_q, machine.q_limits
    moved = home[:, None] + NEAR * np.diag(limits[:, 1] - home)
    found = forward(machine, machine.extension(np.hstack([home[:, None], moved])))
    good = found.converged
    return found.poses.rotation[:, :, good], pose_jacobians(machine, found).actuators[:, 3:, good]


EFFECTS = (PayloadCentre(),)
