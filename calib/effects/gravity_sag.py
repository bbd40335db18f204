"""Legs are springs under the weight they carry: extension_i = c F_i, F_i > 0 in tension.

Virtual work gives F_i = w . t_i with the weight's wrench w and the platform's twist t_i per unit
of extension i. The same expression is the motor torque Q_i = -dV/dq_i of a machine with rotary
actuators, whose motors yield by dq_i = c Q_i.

Where the machine file says that rods are springs (trait ``yields``), the actuators hold and the
platform gives way by the compliance of the elastic closure itself: rods are springs of c, other
compliances of the closure are in the file's proportion to them.
"""

from functools import lru_cache

import numpy as np

from calib.arrays import Array, BoolArray
from calib.effects.component import Effect, Signature, Situation, alone
from calib.effects.link_weight import link_forces, link_mass_kg
from calib.mechanism.closure import Closure
from calib.mechanism.compiled import compile_machine
from calib.mechanism.description import Machine
from calib.mechanism.sweep import Standing
from calib.runs.header import Load
from calib.runs.stack import Rows
from calib.unknown import Unknown

WEIGHT_UPWARDS = (
    "gravity in [load], the sign of z, or payload_kg (rows with and without it exchanged) is the "
    "wrong way round"
)
"""What makes a compliance negative."""


def actuator_forces(situation: Situation) -> Array:
    """Force (N) or torque (N mm) that the weight puts into each actuator, shape (n, N)."""
    rows = situation.rows
    wrench = np.concatenate(weight_wrench(rows, situation.rotation))
    forces: Array = np.einsum("icr,cr->ir", situation.actuator_twists, wrench)
    return forces + link_forces(rows) if link_mass_kg(rows.machine) else forces


def weight_wrench(rows: Rows, rotation: Array) -> tuple[Array, Array]:
    """Force (3, N) in N and moment (3, N) in N mm about the platform's origin, base axes."""
    payload = rows.channels.get("payload_kg")
    carried = np.zeros(rows.count) if payload is None else payload
    if len(rows.runs) == 1:
        return _weighs(rows.runs[0].header.load, carried, rotation)
    force, moment = np.zeros((3, rows.count)), np.zeros((3, rows.count))
    for index, run in enumerate(rows.runs):
        here = np.flatnonzero(rows.run == index)
        force[:, here], moment[:, here] = _weighs(
            run.header.load, carried[here], rotation[:, :, here]
        )
    return force, moment


def _weighs(load: Load | None, payload: Array, rotation: Array) -> tuple[Array, Array]:
    """The same of one run."""
    if load is None:
        return np.zeros((3, payload.size)), np.zeros((3, payload.size))
    mass, (x, y, z) = load.platform_mass_kg, load.gravity.tolist()
    lever = (mass * load.platform_com)[:, None] + payload * load.payload_com[:, None]
    arm = np.einsum("ijn,jn->in", rotation, lever)
    across = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])  # across @ v = v x gravity
    return (mass + payload) * load.gravity[:, None], across @ arm


def weightless(rows: Rows) -> str:
    """Say why readings tell nothing of the weight: no [load], no mass; empty if they do."""
    loads = [run.header.load for run in rows.runs if run.header.load is not None]
    if not loads:
        return "run.toml has no [load]"
    known = rows.on_platform & under_load(rows)
    masses = rows.channels.get("payload_kg", np.zeros(rows.count))
    if not np.isfinite(masses[known]).any():
        return "the column payload_kg is empty"
    weight = max(load.platform_mass_kg for load in loads) + link_mass_kg(rows.machine)
    if weight == 0.0 and not np.nan_to_num(masses[known]).any():
        return "neither platform nor payload has a mass"
    return ""


def under_load(rows: Rows) -> BoolArray:
    """Readings (N,) of runs that say what the machine carries."""
    stated = np.array([run.header.load is not None for run in rows.runs], dtype=bool)
    return np.asarray(stated[rows.run])


@lru_cache(maxsize=64)
def spring_compliance(machine: Machine) -> float:
    """Compliance of the rods that are springs in the machine file, mm/N; 0 without any."""
    named = [
        limb.elements[limb.traits.yields].compliance
        for limb in machine.limbs
        if limb.traits.yields is not None
    ]
    return max(named, default=0.0)


class GravitySag(Effect):
    """One compliance for everything that yields."""

    id = "gravity-sag"
    kind = "machine"
    says = "legs, rods or drives give way under the weight of platform and payload"
    depends = ("run", "payload_kg")
    wrong_sign = WEIGHT_UPWARDS
    wrong_size = "payload_kg, or a mass in [load], is not in kg (payload in grams?)"

    def lacking(self, machine: Machine) -> str:
        """Springs must be part of an elastic closure; actuators yield on any machine."""
        if spring_compliance(machine) and not compile_machine(machine).redundant:
            return "its springs carry no load that limbs share (trait yields)"
        return ""

    def unavailable(self, rows: Rows) -> str:
        """Without a weight."""
        return weightless(rows)

    def told(self, rows: Rows) -> BoolArray:
        """Those of runs with [load]."""
        return under_load(rows)

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``gravity-sag.c``, mm/N or rad/(N mm); ``.c_linear`` and ``.c_rotary`` where both are."""
        if spring_compliance(rows.machine):
            return (Unknown("gravity-sag.c", "mm/N", 1e-4),)
        axes = rows.machine.axes
        units = rows.machine.axes_by_unit
        first = [axes[own[0]] for own in units.values()]
        return tuple(
            Unknown(
                "gravity-sag.c" if len(units) == 1 else f"gravity-sag.c_{axis.kind}",
                axis.compliance_unit,
                axis.compliance,
            )
            for axis in first
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Linear or rotary actuators alone."""
        count = len(self.unknowns(rows))
        return alone(count) if count > 1 else ()

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Actuator forces; or what the platform gives way for springs of 1 mm/N."""
        spring = spring_compliance(situation.machine)
        if spring:
            wrench = weight_wrench(situation.rows, situation.rotation)
            return Signature(twist=given_way(situation, *wrench)[None] / spring)
        forces, units = actuator_forces(situation), situation.machine.axes_by_unit
        if len(units) == 1:
            return Signature(extension=forces[None])
        shape = np.zeros((len(units), *forces.shape))
        for number, own in enumerate(units.values()):
            shape[number, own] = forces[own]
        return Signature(extension=shape)


def given_way(situation: Situation, force: Array, moment: Array) -> Array:
    """Twist (6, N) of the platform by the closure's own compliance, base axes.

    ``force`` (3, N) in N, ``moment`` (3, N) in N mm about the platform's origin.
    """
    size = situation.machine.size
    wrench = np.concatenate([force * size, moment])
    compliance = _platform_compliance(situation)[:, :, situation.state_of]
    twist = np.einsum("ijn,jn->in", compliance, wrench)
    twist[:3] *= size
    return np.asarray(twist)


def _platform_compliance(situation: Situation) -> Array:
    """Inverse of A^T A (6, 6, M), A the closure's rows whitened by their flexibility.

    In the engine's scaled twists (translations as parts of the machine's size).
    """
    closed, held = situation.closed, situation.parameters
    columns = held[:, None] if held.ndim == 1 else held
    closure = Closure(situation.closing, columns, closed.extension, Standing.of(closed))
    rows, _ = closure.rows()
    stacked = np.moveaxis(rows, -1, 0)
    inverse = np.linalg.inv(np.swapaxes(stacked, 1, 2) @ stacked)
    return np.asarray(np.moveaxis(inverse, 0, -1))


EFFECTS = (GravitySag(),)
