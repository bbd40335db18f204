"""Arms from and to URDF: a machine file of a URDF's chain, and a URDF of a calibrated arm."""

import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from app.files.text import read_text
from app.files.urdf import MOVING, UrdfArm, UrdfJoint, angles_of, read_urdf, transform, urdf_text
from app.jobs.completing import completed
from calib.arrays import Array
from calib.errors import BadInput
from calib.mechanism.check import pose_in_file
from calib.mechanism.description import Element, Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.parse import parse_machine
from calib.mechanism.solve import Configuration, forward
from calib.mechanism.task import FULL

TRIED = 400
SEED = 1
WIDEST = float(np.pi / 2)
"""Farthest from zero that a joint is at home, rad."""
BOX_MM, BOX_RAD = 0.08, float(np.deg2rad(15.0))
"""Half of the workspace box: a part of the arm's length, and an angle."""
KEPT = 1e-12
"""Lengths (mm) and angles (rad) below which nothing is written into a chain."""


def machine_of_urdf(
    file: Path,
    *,
    name: str = "",
    base: str = "",
    tip: str = "",
    tolerance_mm: float = 0.5,
    tolerance_rad: float = 3e-3,
    tool: bool = False,
) -> str:
    """Text of the machine file of a URDF's chain, with the errors that a calibration can see.

    Errors are those of ``machine complete``: by rank, of the tolerances that are given; with
    ``tool`` also those of the nests on the flange.

    Raises
    ------
    BadInput
        For a URDF that is none, or a chain that cannot be calibrated; with its place.
    """
    arm = read_urdf(read_text(file), str(file), base, tip)
    name = name or re.sub(r"[^a-z0-9-]+", "-", arm.name.lower()).strip("-") or "arm"
    q = _home(arm)
    place = f"{file}"
    bare = parse_machine(_text(arm, name, q, "pose = {}", None), place)
    home = forward(bare, bare.home_q[:, None])
    text = _text(arm, name, q, pose_in_file(home.poses), home)
    usual = {"mm": tolerance_mm, "rad": tolerance_rad}
    return completed(text, parse_machine(text, place), usual, tool=tool).text


def _driven(arm: UrdfArm) -> list[UrdfJoint]:
    return [one for one in arm.joints if one.kind in MOVING and one.mimic is None]


def _limits(one: UrdfJoint) -> tuple[float, float]:
    """In mm or rad; a joint that turns without end has a turn either way."""
    scale = 1.0 if MOVING[one.kind] else 1000.0
    low, high = one.limits or ((-2.0 * np.pi, 2.0 * np.pi) if MOVING[one.kind] else (-1.0, 1.0))
    return float(scale * low), float(scale * high)


def _home(arm: UrdfArm) -> Array:
    """Joint values, mm or rad, far from where the arm is singular: the best of a fixed sequence."""
    driven = _driven(arm)
    limits = np.array([_limits(one) for one in driven])
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
        low, high = _limits(one)
        unit = "rad" if MOVING[one.kind] else "mm"
        actuators.append(
            f'q{k} = {{ unit = "{unit}", home = {float(value)!r}, limits = [{low!r}, {high!r}], '
            f'says = "{_plain(one.name)}" }}'
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
            *_words(arm, driven),
            '"""',
            "",
        ]
    )


def _box(home: Configuration) -> list[str]:
    values = home.poses.to_xyz_rpy()[:, 0]
    length = BOX_MM * max(float(np.linalg.norm(values[:3])), 100.0)
    halves = [length] * 3 + [BOX_RAD] * 3
    return [
        f"{name} = [{float(value - half)!r}, {float(value + half)!r}]"
        for name, value, half in zip(FULL, values, halves, strict=True)
    ]


def _plain(text: str) -> str:
    return re.sub(r'["\\]', "", text)


def _words(arm: UrdfArm, driven: list[UrdfJoint]) -> list[str]:
    """The chain, a line a joint; joints that follow another name its actuator."""
    names = {one.name: (f"q{k}", MOVING[one.kind]) for k, one in enumerate(driven, start=1)}
    lines = []
    for one in arm.joints:
        words = [f"t{a}:{1000.0 * v!r}" for a, v in zip("xyz", map(float, one.xyz), strict=True)
                 if abs(1000.0 * v) > KEPT]  # fmt: skip
        roll, pitch, yaw = map(float, one.rpy)
        turns = (("z", yaw), ("y", pitch), ("x", roll))
        words += [f"r{a}:{v!r}" for a, v in turns if abs(v) > KEPT]
        if one.kind in MOVING:
            words += _moving(one, _drive(one, names, arm.name))
        if words:
            lines.append(" ".join(words))
    return lines


def _drive(
    one: UrdfJoint, driven: Mapping[str, tuple[str, bool]], place: str
) -> tuple[float, str, str, float]:
    """Factor, its unit, actuator and offset of a joint's value, mm or rad."""
    turns = MOVING[one.kind]
    if one.mimic is None:
        return 1.0, "", driven[one.name][0], 0.0
    leader, factor, offset = one.mimic
    if leader not in driven:
        raise BadInput(
            f'joint "{one.name}" follows "{leader}", which is not on the way to the tip',
            place=place,
            remedy="Name another --tip",
        )
    name, leads_by_turning = driven[leader]
    unit = ""
    if turns != leads_by_turning:
        factor, unit = (factor / 1000.0, "rad/mm") if turns else (factor * 1000.0, "mm/rad")
    return factor, unit, name, offset * (1.0 if turns else 1000.0)


def _moving(one: UrdfJoint, drive: tuple[float, str, str, float]) -> list[str]:
    """A joint about an axis: one of the frame's own, or its z turned there and back."""
    factor, unit, q, offset = drive
    letter = "R" if MOVING[one.kind] else "T"
    along = int(np.argmax(np.abs(one.axis)))
    sign = float(np.sign(one.axis[along]))
    straight = np.abs(one.axis[along]) > 1.0 - 1e-12
    factor = factor * sign if straight else factor
    offset = offset * sign if straight else offset
    value = q if factor == 1.0 and not unit else f"{factor!r}{unit}*{q}"
    value += f"{offset:+.17g}" if offset else ""
    if straight:
        return [f"{letter}{'xyz'[along]}:{value}"]
    x, y, z = map(float, one.axis)
    swing, lean = float(np.arctan2(y, x)), float(np.arctan2(np.hypot(x, y), z))
    return [
        f"rz:{swing!r}",
        f"ry:{lean!r}",
        f"{letter}z:{value}",
        f"ry:{-lean!r}",
        f"rz:{-swing!r}",
    ]


def urdf_of(
    machine: Machine, values: Mapping[str, float], controller: Mapping[str, float], remark: str
) -> str:
    """A URDF of an arm with the geometry that was found.

    What the controller takes off its coordinates (references) is in the URDF: its joints are q.

    Raises
    ------
    BadInput
        For a machine that is no serial chain of driven joints.
    """
    if len(machine.limbs) != 1 or machine.joints:
        raise BadInput(
            f'"{machine.name}" is no serial chain of driven joints: URDF holds no closed loop',
            place="--as urdf",
            remedy="Export parameters in another form",
        )
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
