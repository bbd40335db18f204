"""Legs are springs under the weight they carry: extension_i = c F_i, F_i > 0 in tension.

Virtual work gives F_i = w . t_i with the weight's wrench w and the platform's twist t_i per unit
of extension i. The same expression is the motor torque Q_i = -dV/dq_i of a machine with rotary
actuators, whose motors yield by dq_i = c Q_i. Over-constrained machines whose rods are springs
have a definition of their own.
"""

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, Unknown, alone
from calib.mechanism.axes import units_of
from calib.mechanism.description import Machine
from calib.mechanism.rigid import cross, rotate
from calib.runs.stack import Rows


def actuator_forces(situation: Situation) -> Array:
    """Force (N) or torque (N mm) that the weight puts into each actuator, shape (n, N)."""
    rows = situation.rows
    force, moment = weight_wrench(rows, situation.rotation)
    twists = situation.actuator_twists
    forces: Array = np.einsum("icr,cr->ir", twists[:, :3], force)
    forces += np.einsum("icr,cr->ir", twists[:, 3:], moment)
    return forces


def weight_wrench(rows: Rows, rotation: Array) -> tuple[Array, Array]:
    """Force (3, N) in N and moment (3, N) in N mm about the platform's origin, base axes."""
    payload = rows.channels.get("payload_kg", np.zeros(rows.count))
    force, moment = np.zeros((3, rows.count)), np.zeros((3, rows.count))
    for index, run in enumerate(rows.runs):
        load, here = run.header.load, rows.run == index
        if load is None:
            continue
        turned = rotation[:, :, here]
        for mass, centre in (
            (np.full(int(here.sum()), load.platform_mass_kg), load.platform_com),
            (payload[here], load.payload_com),
        ):
            weight = mass * load.gravity[:, None]
            force[:, here] += weight
            moment[:, here] += cross(rotate(turned, centre[:, None]), weight)
    return force, moment


class GravitySag(Effect):
    """One compliance for all actuators."""

    id = "gravity-sag"
    kind = "machine"
    says = "the legs give way under the weight of platform and payload"
    depends = ("payload_kg",)

    def applies(self, machine: Machine) -> bool:
        """Where the actuators yield; a tripod's rods do, by a definition of their own."""
        detailed = machine.detailed or machine
        rods = any(parameter.name.endswith(".dh1") for parameter in detailed.parameters)
        return bool(machine.actuators) and not rods

    def unavailable(self, rows: Rows) -> str:
        """Without [load] there is no weight to speak of."""
        if any(run.header.load is None for run in rows.runs):
            return "run.toml has no [load]"
        masses = rows.channels.get("payload_kg", np.zeros(rows.count))
        if not np.isfinite(masses[rows.on_platform]).any():
            return "the column payload_kg is empty"
        weight = max(r.header.load.platform_mass_kg for r in rows.runs if r.header.load is not None)
        if weight == 0.0 and not np.nan_to_num(masses).any():
            return "neither platform nor payload has a mass"
        return ""

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``gravity-sag.c``, mm/N or rad/(N mm); ``.c_linear`` and ``.c_rotary`` where both are."""
        axes = rows.machine.axes
        units = units_of(axes)
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
        return alone(len(units_of(rows.machine.axes)))

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Actuator forces."""
        forces, units = actuator_forces(situation), units_of(situation.machine.axes)
        shape = np.zeros((len(units), *forces.shape))
        for number, own in enumerate(units.values()):
            shape[number, own] = forces[own]
        return Signature(extension=shape)


EFFECTS = (GravitySag(),)
