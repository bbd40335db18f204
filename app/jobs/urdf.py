"""Arms from and to URDF: a machine file of a URDF's chain, and a URDF of a calibrated arm."""

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from app.files.text import read_text
from app.files.urdf import (
    MOVING,
    UrdfArm,
    UrdfJoint,
    angles_of,
    read_tree,
    read_urdf,
    transform,
    urdf_text,
    xml_of,
)
from app.files.urdf_chain import limits_of, plain, words_of
from app.files.urdf_loops import loops_in_toml, loops_in_urdf
from app.jobs.completing import completed
from app.jobs.urdf_closed import Tree, closed_text
from app.jobs.urdf_loops_out import closed_urdf
from calib.arrays import Array
from calib.errors import BadInput
from calib.mechanism.check import pose_in_file, require_sound
from calib.mechanism.description import Element, Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.parse import parse_machine
from calib.mechanism.solve import Configuration, forward
from calib.mechanism.task import FULL

TRIED = 400
SEED = 1
WIDEST = float(np.pi / 2)
"""Farthest from zero that a joint is at home, rad."""
LEFT_OUT = "# left out: the mass"
"""Begins the comment about a link whose centre of mass cannot be where the URDF has it."""
BOX_MM, BOX_RAD = 0.08, float(np.deg2rad(15.0))
"""Half of the workspace box: a part of the arm's length, and an angle."""


def machine_of_urdf(
    file: Path,
    *,
    name: str = "",
    base: str = "",
    tip: str = "",
    loops: Path | None = None,
    tolerance_mm: float = 0.5,
    tolerance_rad: float = 3e-3,
    tool: bool = False,
) -> str:
    """Text of the machine file of a URDF, with the errors that a calibration can see.

    A chain, or the limbs of a parallel machine where ``loops`` names a list of constraints or the
    URDF holds some (:mod:`app.files.urdf_loops`).

    Errors are those of ``machine complete``: by rank, of the tolerances that are given; with
    ``tool`` also those of the nests on the flange.

    Raises
    ------
    BadInput
        For a URDF that is none, or a chain that cannot be calibrated; with its place.
    """
    place, text = f"{file}", read_text(file)
    root = xml_of(text, place)
    name = name or re.sub(r"[^a-z0-9-]+", "-", root.get("name", "arm").lower()).strip("-") or "arm"
    usual = {"mm": tolerance_mm, "rad": tolerance_rad}
    closing = (
        loops_in_urdf(root, place) if loops is None else loops_in_toml(read_text(loops), f"{loops}")
    )
    if closing.loops:
        text = closed_text(Tree(*read_tree(root, place), place), closing, name, base)
        machine = parse_machine(text, place)
        require_sound(machine, text)
        return completed(text, machine, usual, tool=tool).text
    arm = read_urdf(text, place, base, tip)
    q = _home(arm)
    bare = parse_machine(_text(arm, name, q, "pose = {}", None), place)
    home = forward(bare, bare.home_q[:, None])
    text = _text(arm, name, q, pose_in_file(home.poses), home)
    return completed(text, parse_machine(text, place), usual, tool=tool).text


def _driven(arm: UrdfArm) -> list[UrdfJoint]:
    return [one for one in arm.joints if one.kind in MOVING and one.mimic is None]


def _home(arm: UrdfArm) -> Array:
    """Joint values, mm or rad, far from where the arm is singular: the best of a fixed sequence."""
    driven = _driven(arm)
    limits = np.array([limits_of(one) for one in driven])
    reach = np.array([WIDEST if MOVING[one.kind] else np.inf for one in driven])
    low, high = np.maximum(limits[:, 0], -reach), np.minimum(limits[:, 1], reach)
    low, high = np.where(low < high, low, limits[:, 0]), np.where(low < high, high, limits[:, 1])
    unit = np.random.default_rng(SEED).random((len(driven), TRIED))
    # A tenth of the range is left at either end: home is no place at a stop.
    tried = low[:, None] + (high - low)[:, None] * (0.1 + 0.8 * unit)
    machine = parse_machine(_text(arm, "arm", tried[:, 0], "pose = {}", None), arm.name)
    at = forward(machine, tried)
    moves = np.moveaxis(pose_jacobians(machine, at).actuators, -1, 0)
    moves[:, :, :3] /= machine.size
    sizes = np.linalg.svd(moves, compute_uv=False)
    best: Array = np.round(tried[:, int(np.argmax(sizes[:, -1] / sizes[:, 0]))], 3)
    return best


def _text(arm: UrdfArm, name: str, q: Array, pose: str, home: Configuration | None) -> str:
    """A machine file without errors."""
    actuators = []
    driven = _driven(arm)
    for k, (one, value) in enumerate(zip(driven, q, strict=True), start=1):
        low, high = limits_of(one)
        unit = "rad" if MOVING[one.kind] else "mm"
        actuators.append(
            f'q{k} = {{ unit = "{unit}", home = {float(value)!r}, limits = [{low!r}, {high!r}], '
            f'says = "{plain(one.name)}"{_gear(arm, one)} }}'
        )
    count = min(len(driven), len(FULL))
    if count < len(FULL):
        raise BadInput(
            f"{len(driven)} driven joints do not command a whole pose",
            place=arm.name,
            remedy="Write its machine file with a [task] of its own: docs/machine-files.md",
        )
    box = [] if home is None else ["[workspace]", *_box(home), ""]
    return "\n".join(
        [
            f"# {name}: the chain of a URDF. Lengths in mm, angles in rad.",
            'format = "pkm-machine/1"',
            f'name = "{name}"',
            f'says = "serial chain of {len(driven)} joints, from a URDF"',
            "",
            "[home]",
            pose,
            "",
            *box,
            "[actuators]",
            *actuators,
            "",
            "[limbs.arm]",
            'chain = """',
            *words_of(arm.joints, driven, arm.name, named=_links(arm)),
            '"""',
            "",
            *_masses(arm),
        ]
    )


def _gear(arm: UrdfArm, one: UrdfJoint) -> str:
    ratio = arm.gears.get(one.name, 0.0) if MOVING[one.kind] else 0.0
    return f", gear = {ratio!r}" if ratio else ""


def _links(arm: UrdfArm) -> dict[str, str]:
    """Names of what stands behind the joints that carry a mass."""
    moving = [one.name for one in arm.joints if one.kind in MOVING]
    return {
        one.joint: f"link{moving.index(one.joint) + 1}"
        for one in arm.masses
        if not arm.nowhere(one)
    }


def _masses(arm: UrdfArm) -> list[str]:
    """What the links weigh, as traits."""
    names = _links(arm)
    lines = ["[limbs.arm.traits.masses]"] if names else []
    for number, one in enumerate(arm.masses, start=1):
        centre = [round(1000.0 * float(v), 6) for v in one.centre]
        if arm.nowhere(one):
            lines.append(
                f"{LEFT_OUT} of {plain(one.link)}, {one.kg!r} kg: the URDF has its centre "
                f"{float(np.linalg.norm(one.centre)):.3g} m from {plain(one.joint)}"
            )
            continue
        lines.append(
            f'm{number} = {{ behind = "{names[one.joint]}", mass_kg = {one.kg!r}, '
            f"com = {centre} }}  # {re.sub(r'[^ -~]', '', one.link)}"
        )
    return [*lines, ""] if lines else []


def _box(home: Configuration) -> list[str]:
    values = home.poses.to_xyz_rpy()[:, 0]
    length = BOX_MM * max(float(np.linalg.norm(values[:3])), 100.0)
    halves = [length] * 3 + [BOX_RAD] * 3
    return [
        f"{name} = [{float(value - half)!r}, {float(value + half)!r}]"
        for name, value, half in zip(FULL, values, halves, strict=True)
    ]


def urdf_of(
    machine: Machine, values: Mapping[str, float], controller: Mapping[str, float], remark: str
) -> str:
    """A URDF of a machine with the geometry that was found; loops are elements of their own.

    What the controller takes off its coordinates (references) is in the URDF: its joints are q.

    Raises
    ------
    BadInput
        For what a URDF cannot say: gears, screws, parts that yield.
    """
    if len(machine.limbs) != 1 or machine.joints:
        return closed_urdf(machine, values, controller, remark)
    parameters = machine.vector(values)
    reference = machine.reference(controller)
    frame = np.eye(4)
    joints: list[UrdfJoint] = []
    leaders: dict[int, str] = {}
    for element in machine.limbs[0].elements:
        fixed = element.constant
        moved: tuple[int, float] | None = None
        for term in element.terms:
            if term.kind == "actuator":
                moved = (term.index, term.factor)
                fixed -= term.factor * float(reference[term.index])
            else:
                fixed += term.factor * float(parameters[term.index])
        frame = frame @ _step(element, fixed)
        if moved is not None:
            joints.append(_joint_of(machine, element, moved, leaders, frame, len(joints)))
            frame = np.eye(4)
    tip = _joint("tip_joint", "fixed", f"link{len(joints)}", "tip", frame)
    return urdf_text(UrdfArm(machine.name, (*joints, tip)), remark)


def _step(element: Element, value: float) -> Array:
    along = np.zeros(3)
    if element.turns:
        along[element.axis] = value
        return transform(np.zeros(3), along)
    along[element.axis] = value * 1e-3
    return transform(along, np.zeros(3))


def _joint(name: str, kind: str, parent: str, child: str, frame: Array) -> UrdfJoint:
    return UrdfJoint(name, kind, parent, child, frame[:3, 3], angles_of(frame[:3, :3]))


def _joint_of(
    machine: Machine,
    element: Element,
    moved: tuple[int, float],
    leaders: dict[int, str],
    frame: Array,
    count: int,
) -> UrdfJoint:
    index, factor = moved
    actuator = machine.actuators[index]
    first = index not in leaders
    if first and (abs(factor) != 1.0 or (actuator.unit == "rad") != element.turns):
        raise BadInput(
            f"actuator {actuator.name} moves its joint through a gear or a screw; a joint of a "
            "URDF is moved by its own coordinate",
            place="--as urdf",
            remedy="Describe the machine by the joint's coordinate",
        )
    kind = "revolute" if element.turns else "prismatic"
    placed = _joint(
        actuator.name if first else f"{actuator.name}_{count + 1}",
        kind,
        f"link{count}" if count else "base",
        f"link{count + 1}",
        frame,
    )
    axis = np.zeros(3)
    axis[element.axis] = np.sign(factor) if first else 1.0
    scale = 1.0 if element.turns else 1e-3
    low, high = (scale * float(v) for v in actuator.limits)
    mimic = None
    if first:
        leaders[index] = actuator.name
    else:
        mimic = (leaders[index], factor, 0.0)
        low, high = sorted((factor * low, factor * high))
    return UrdfJoint(
        placed.name, kind, placed.parent, placed.child, placed.xyz, placed.rpy, axis,
        (low, high), mimic,
    )  # fmt: skip
