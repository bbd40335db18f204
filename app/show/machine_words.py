"""What a machine file describes, in words and as data."""

from typing import Any

import numpy as np

from app.show.text_table import text_table
from app.show.trait_words import trait_data, trait_words
from calib.analysis.inspection import Inspection
from calib.mechanism.check import pose_in_file
from calib.mechanism.description import Machine
from calib.mechanism.solve import home_configuration
from calib.mechanism.variants import closure_names
from calib.poses.verification import VerificationGrid

SHOWN = 8


def inspection_data(found: Inspection, grid: VerificationGrid) -> dict[str, Any]:
    """The answer as data; mm and rad."""
    machine = found.machine
    return {
        "format": "pkm-machine-check/1",
        "machine": machine.name,
        "limbs": [
            {
                "name": limb.name,
                "passive_joints": len(limb.joints),
                "wrenches": 6 - len(limb.joints),
            }
            for limb in machine.limbs
        ],
        "parameters": len(machine.parameters),
        "actuators": [a.name for a in machine.actuators],
        "task": machine.task.coordinates,
        "home_gap_mm": found.home_gap_mm,
        "home_gap_rad": found.home_gap_rad,
        "home_pose": [float(v) for v in home_configuration(machine).poses.to_xyz_rpy()[:, 0]],
        "constraints": found.constraints,
        "redundant": found.redundant,
        "freedoms_held": found.freedoms_held,
        "mobility": found.mobility,
        "rank": found.rank,
        "stiffness_home": found.stiffness_home,
        "stiffness_least": found.stiffness_least,
        "reach": found.reach,
        "stopped_by": {stop.what: stop.part for stop in found.stops},
        "used": found.used,
        "verification_box": grid.box,
        "verification_scale": grid.scale,
        "closures": closure_names(machine),
        **trait_data(machine),
    }


def inspection_words(found: Inspection, grid: VerificationGrid) -> str:
    """The answer for a person."""
    machine = found.machine
    parts = [
        f"{machine.name}: {machine.says}",
        _structure(found),
        f"Home: closes {found.home_gap_mm:.2g} mm and {np.rad2deg(found.home_gap_rad):.2g} deg "
        "from the stated pose:\n  " + pose_in_file(home_configuration(machine).poses),
        _constraints(found),
        _rank(found),
        _singularity(found),
        _reach(found, grid),
        _limits(found),
        trait_words(machine),
    ]
    return "\n\n".join(part for part in parts if part)


def _structure(found: Inspection) -> str:
    machine = found.machine
    kinds: dict[str, list[str]] = {}
    for limb in machine.limbs:
        kinds.setdefault(_joints(machine, limb.name), []).append(limb.name)
    lines = [f"  {', '.join(names)}: {joints}" for joints, names in kinds.items()]
    return (
        f"{len(machine.limbs)} limb{'s' * (len(machine.limbs) > 1)}, "
        f"{len(machine.actuators)} actuators, "
        f"{len(machine.parameters)} parameters; commands {', '.join(machine.task.coordinates)} "
        "([driven] joints in brackets).\n" + "\n".join(lines)
    )


def _joints(machine: Machine, name: str) -> str:
    """Letters of a limb's joints, driven ones in [brackets]: ``RRR[P]RR``."""
    limb = next(b for b in machine.limbs if b.name == name)
    letters, seen = [], set()
    for element in limb.elements:
        for term in element.terms[:1]:
            letter = "R" if element.turns else "P"
            if term.kind == "actuator":
                letters.append(f"[{letter}]")
            elif term.kind == "passive" and term.index not in seen:
                seen.add(term.index)
                letters.append(letter)
    return "".join(letters)


def _constraints(found: Inspection) -> str:
    text = (
        f"Mobility: with the actuators held, {found.constraints} constraints hold "
        f"{found.freedoms_held} of the platform's 6 freedoms; the actuators move "
        f"{found.mobility} of {len(found.machine.task.coordinates)} commanded coordinates."
    )
    if found.redundant > 0:
        one = found.redundant == 1
        text += (
            f"\nOver-constrained: {found.redundant} constraint{'' if one else 's'} more than "
            "needed; the limbs share what does not fit by their compliances."
        )
        names = closure_names(found.machine)
        text += f" Other closures in the file: {', '.join(names)}." if names else ""
    return text


def _rank(found: Inspection) -> str:
    count = len(found.machine.parameters)
    if found.rank == count:
        return f"Parameters: all {count} are independent if whole poses are read."
    return (
        f"Parameters: whole poses show {found.rank} independent combinations of {count}; see "
        f"pkmcal identifiability {found.machine.name}."
    )


def _singularity(found: Inspection) -> str:
    part = found.stiffness_least / found.stiffness_home if found.stiffness_home > 0.0 else 0.0
    near = "near a singularity" if part < 0.1 else "far from singularities"
    return (
        f"Singularities: over the workspace the constraints are at worst {part:.2f} times as well "
        f"conditioned as at home: {near}."
    )


def _reach(found: Inspection, grid: VerificationGrid) -> str:
    text = f"Reach: {100 * found.reach:.0f} % of the workspace box."
    if found.stops:
        stops = [f"{s.what} ({100 * s.part:.0f} %)" for s in found.stops[:SHOWN]]
        text += f" The rest is stopped by {', '.join(stops)}."
    spans = [f"{name} {_range(name, *grid.box[name])}" for name in grid.box]
    return (
        f"{text}\nThe whole grid of {len(grid.labels)} verification poses fits into "
        f"{100 * grid.scale:.1f} % of the box: {'; '.join(spans)}."
    )


def _range(name: str, low: float, high: float) -> str:
    if name in "xyz":
        return f"{low:.2f} .. {high:.2f} mm"
    return f"{np.rad2deg(low):.2f} .. {np.rad2deg(high):.2f} deg"


def _limits(found: Inspection) -> str:
    machine = found.machine
    rows = []
    for actuator, axis in zip(machine.actuators, machine.axes, strict=True):
        low, high = found.used.get(actuator.name, (float("nan"), float("nan")))
        scale, unit = (1.0, "mm") if axis.unit == "mm" else (float(np.rad2deg(1.0)), "deg")
        if axis.unit == "rad" and axis.moves == "mm":
            scale, unit = 0.5 / np.pi, "turn"
        cells = [v * scale for v in (*actuator.limits, low, high)]
        rows.append([actuator.name, unit, *(f"{cell:.2f}" for cell in cells)])
    for limb in machine.limbs:
        for joint in limb.joints:
            if not np.any(np.isfinite(joint.limits)):
                continue
            name = f"{limb.name}.{joint.name}"
            low, high = found.used.get(name, (float("nan"), float("nan")))
            scale, unit = (float(np.rad2deg(1.0)), "deg") if joint.turns else (1.0, "mm")
            cells = [v * scale for v in (*joint.limits, low, high)]
            rows.append([name, unit, *(f"{cell:.2f}" for cell in cells)])
    header = ["Limits", "unit", "from", "to", "used from", "to"]
    return text_table(header, rows)
