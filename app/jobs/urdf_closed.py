"""Parallel machines from and to URDF: a tree, and the loops that close it (files/urdf_loops.py)."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from app.files.urdf import MOVING, UrdfArm, UrdfJoint, angles_of, chain_of, transform, urdf_text
from app.files.urdf_chain import Passive, limits_of, plain, words_of
from app.files.urdf_loops import Loop, Loops, written_loops
from calib.arrays import Array
from calib.errors import BadInput
from calib.mechanism.compiled import compile_machine
from calib.mechanism.description import Element, Machine
from calib.mechanism.rigid import from_euler
from calib.mechanism.solve import home_configuration
from calib.mechanism.task import FULL

BOX_MM, BOX_RAD = 0.05, float(np.deg2rad(8.0))
"""Half of the workspace box: a part of the machine's size, and an angle."""
TURNS = {"ball": ("xyz", "yzx", "zxy"), "universal": ("xy",), "hinge": ("z",)}
"""Axes of a closing joint, in the order in which they turn; of a ball that order is free."""


@dataclass(frozen=True, eq=False)
class Tree:
    """The joints of a URDF, and the joint of every link to its parent."""

    name: str
    joints: Sequence[UrdfJoint]
    by_child: Mapping[str, UrdfJoint]
    source: str

    def way(self, base: str, tip: str) -> list[UrdfJoint]:
        """Joints from one link to another."""
        return chain_of(dict(self.by_child), list(self.joints), base, tip, self.source)


def closed_text(tree: Tree, loops: Loops, name: str, base: str) -> str:
    """A machine file, without errors, of the limbs that hold the platform.

    Raises
    ------
    BadInput
        For loops that do not hold on to the platform, limbs that share a joint, or without drives.
    """
    home = dict(loops.home or {})
    _check(tree, loops, home)
    limbs = {"limb1": tree.way(base, loops.platform)} if loops.platform in tree.by_child else {}
    passive: dict[str, Passive] = {}
    to_platform = _frame(limbs.get("limb1", []), home)
    for one in loops.loops:
        joints = [*tree.way(base, one.first), *_closing(tree, loops, one, home, base, to_platform)]
        limbs[f"limb{len(limbs) + 1}"] = joints
    driven = _driven(tree, loops, limbs)
    for joints in limbs.values():
        passive |= _passive(joints, driven, home)
    return _file(name, driven, limbs, passive, home, _task(tree, loops, driven), to_platform)


def _check(tree: Tree, loops: Loops, home: Mapping[str, float]) -> None:
    names = {one.name for one in tree.joints}
    for what, listed in (("actuated", loops.actuated), ("home", tuple(home))):
        missing = next((one for one in listed if one not in names), None)
        if missing is not None:
            raise BadInput(
                f'{what} names "{missing}", which is no joint',
                place=tree.source,
                remedy=f"Joints are {', '.join(sorted(names))}",
            )
    if not loops.actuated:
        raise BadInput(
            "nothing says which joints are driven",
            place=tree.source,
            remedy="List them, actuated = [...] in the file of --loops, or a <transmission> each",
        )


def _driven(tree: Tree, loops: Loops, limbs: Mapping[str, Sequence[UrdfJoint]]) -> list[UrdfJoint]:
    """Joints with a drive in their order; a limb's moving joint may be in no other limb."""
    seen: dict[str, str] = {}
    for limb, joints in limbs.items():
        for one in joints:
            if one.kind in MOVING and seen.setdefault(one.name, limb) != limb:
                raise BadInput(
                    f'{seen[one.name]} and {limb} share the joint "{one.name}"',
                    place=tree.source,
                    remedy="Limbs part at the base: name a --base behind what they share",
                )
    by_name = {one.name: one for joints in limbs.values() for one in joints}
    absent = next((name for name in loops.actuated if name not in by_name), None)
    if absent is not None:
        raise BadInput(
            f'the driven joint "{absent}" is on no way to the platform',
            place=tree.source,
            remedy="Leave it out, or list the loop that it belongs to",
        )
    return [by_name[name] for name in loops.actuated]


def _task(tree: Tree, loops: Loops, driven: Sequence[UrdfJoint]) -> tuple[str, ...]:
    if loops.coordinates:
        return loops.coordinates
    if len(driven) < len(FULL):
        raise BadInput(
            f"{len(driven)} driven joints do not command a whole pose",
            place=tree.source,
            remedy='Say what is commanded in the file of --loops: coordinates = ["x", "y", "z"]',
        )
    return FULL


def _closing(
    tree: Tree, loops: Loops, one: Loop, home: Mapping[str, float], base: str, platform: Array
) -> list[UrdfJoint]:
    """From the last link of a limb through the closing joint to the platform."""
    label = re.sub(r"\W", "_", f"{one.first}_{one.second}")
    back: Array = np.asarray(np.linalg.inv(one.in_second), dtype=np.float64)
    if one.second != loops.platform:
        fixed = tree.way(loops.platform, one.second)
        if any(joint.kind in MOVING for joint in fixed):
            raise BadInput(
                f'"{one.second}" is not fixed to the platform "{loops.platform}"',
                place=tree.source,
                remedy="A loop holds on to the platform, or to a link that is fixed to it",
            )
        back = back @ np.linalg.inv(_frame(fixed, {}))
    here = _frame(tree.way(base, one.first), home) @ one.in_first
    there = platform @ np.linalg.inv(back)
    joints = [_fixed(f"{label}_at", np.asarray(one.in_first))]
    if one.kind == "slide":
        along = np.array([0.0, 0.0, 1.0])
        joints.append(UrdfJoint(f"{label}_z", "prismatic", "", "", axis=along))
    elif one.kind in TURNS:
        joints += _turns(label, one.kind, here[:3, :3].T @ there[:3, :3])
    return [*joints, _fixed(f"{label}_on", back)]


def _turns(label: str, kind: str, rotation: Array) -> list[UrdfJoint]:
    """Joints about axes in turn; ``rpy`` of the first holds nothing, the start is in ``limits``.

    A ball joint is three turns: in the order in which the middle one is farthest from 90 deg.
    """
    orders = [(order, _angles(order, rotation)) for order in TURNS[kind]]
    order, start = min(orders, key=lambda one: abs(one[1][1]) if len(one[0]) > 2 else 0.0)
    return [
        UrdfJoint(f"{label}_{axis}", "revolute", "", "", axis=np.eye(3)["xyz".index(axis)],
                  mimic=("", float(angle), 0.0))
        for axis, angle in zip(order, start, strict=False)
    ]  # fmt: skip


def _angles(order: str, rotation: Array) -> Array:
    """Angles (3,) by which turns about the axes of ``order``, and then a third, are a rotation."""
    i, j = ("xyz".index(axis) for axis in (order + "xy")[:2])
    k = 3 - i - j if i != j else (i + 2) % 3
    # R = R_i(a) R_j(b) R_k(c) with i, j, k cyclic.
    b = np.arcsin(np.clip(rotation[i, k], -1.0, 1.0))
    a = np.arctan2(-rotation[j, k], rotation[k, k])
    c = np.arctan2(-rotation[i, j], rotation[i, i])
    return np.array([a, b, c])


def _fixed(name: str, frame: Array) -> UrdfJoint:
    return UrdfJoint(name, "fixed", "", "", frame[:3, 3], angles_of(frame[:3, :3]))


def _frame(joints: Sequence[UrdfJoint], values: Mapping[str, float]) -> Array:
    """Where joints lead (4, 4), m, at values by name, rad or m."""
    at = np.eye(4)
    for one in joints:
        at = at @ transform(one.xyz, one.rpy)
        if one.kind not in MOVING:
            continue
        leader, factor, offset = one.mimic or (one.name, 1.0, 0.0)
        value = factor * values.get(leader, 0.0) + offset
        if MOVING[one.kind]:
            at[:3, :3] = at[:3, :3] @ _turned(one.axis, value)
        else:
            at[:3, 3] += at[:3, :3] @ (one.axis * value)
    return at


def _turned(axis: Array, angle: float) -> Array:
    x, y, z = axis
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K)


def _passive(
    joints: Sequence[UrdfJoint], driven: Sequence[UrdfJoint], home: Mapping[str, float]
) -> dict[str, Passive]:
    """Joints of one limb that nothing drives."""
    drives = {one.name for one in driven}
    own = {one.name for one in joints}
    leaders = {one.mimic[0] for one in joints if one.mimic and one.mimic[0] in own} - drives
    found = {}
    for one in joints:
        closing = one.mimic is not None and not one.mimic[0]
        leader = one.name if one.mimic is None or closing else one.mimic[0]
        if one.kind not in MOVING or leader in drives:
            continue
        if leader in leaders:
            times = 1.0 if leader == one.name else (one.mimic or ("", 1.0, 0.0))[1]
            if abs(times) != 1.0 or (one.mimic and one.mimic[2]):
                raise BadInput(
                    f'joint "{one.name}" follows "{leader}", which nothing drives, by {times:g}',
                    place=one.name,
                    remedy="A joint without a drive is followed as it is, or turned round (-1)",
                )
            found[one.name] = Passive(_word(leader), times=times)
            continue
        start = one.mimic[1] if closing and one.mimic else home.get(one.name, 0.0)
        found[one.name] = Passive(_word(one.name), start * (1.0 if MOVING[one.kind] else 1000.0))
    return found


def _word(name: str) -> str:
    return "j_" + re.sub(r"\W", "_", name)


def _file(
    name: str,
    driven: Sequence[UrdfJoint],
    limbs: Mapping[str, Sequence[UrdfJoint]],
    passive: Mapping[str, Passive],
    home: Mapping[str, float],
    task: Sequence[str],
    platform: Array,
) -> str:
    place = 1000.0 * platform[:3, 3]
    pose = dict(zip(FULL, [*place, *angles_of(platform[:3, :3])], strict=True))
    size = max(float(np.linalg.norm(place)), 100.0)
    lines = [
        f"# {name}: limbs of a URDF. Lengths in mm, angles in rad.",
        'format = "pkm-machine/1"',
        f'name = "{name}"',
        f'says = "{len(limbs)} limbs, {len(driven)} drives, from a URDF"',
        "", "[home]",
        "pose = { " + ", ".join(f"{key} = {float(v)!r}" for key, v in pose.items()) + " }",
        "", "[task]", f"coordinates = [{', '.join(chr(34) + one + chr(34) for one in task)}]",
        "", "[workspace]",
    ]  # fmt: skip
    for key in task:
        half = BOX_MM * size if key in "xyz" else BOX_RAD
        centre = float(pose.get(key, 0.0))
        lines.append(f"{key} = [{centre - half!r}, {centre + half!r}]")
    lines += ["", "[actuators]"]
    for k, one in enumerate(driven, start=1):
        low, high = limits_of(one)
        scale = 1.0 if MOVING[one.kind] else 1000.0
        lines.append(
            f'q{k} = {{ unit = "{"rad" if MOVING[one.kind] else "mm"}", '
            f"home = {scale * home.get(one.name, 0.0)!r}, limits = [{low!r}, {high!r}], "
            f'says = "{plain(one.name)}" }}'
        )
    for limb, joints in limbs.items():
        words = words_of(joints, driven, name, passive)
        lines += ["", f"[limbs.{limb}]", 'chain = """', *words, '"""']
    return "\n".join([*lines, ""])


def closed_urdf(
    machine: Machine, values: Mapping[str, float], controller: Mapping[str, float], remark: str
) -> str:
    """A URDF of a parallel machine with the geometry that was found, and its loops.

    The first limb carries the platform; every other one ends in a link that is welded to it.

    Raises
    ------
    BadInput
        For a machine whose limbs close only because parts yield.
    """
    if compile_machine(machine).redundant:
        raise BadInput(
            f'the limbs of "{machine.name}" close only because parts of them yield: no URDF',
            place="--as urdf",
            remedy="Export parameters in another form",
        )
    parameters, reference = machine.vector(values), machine.reference(controller)
    passive = home_configuration(machine).passive[:, 0]
    joints: list[UrdfJoint] = []
    home: dict[str, float] = {}
    leaders: dict[tuple[str, int], tuple[str, float]] = {}
    ends: list[str] = []
    for number, limb in enumerate(machine.limbs, start=1):
        link, frame = "base", np.eye(4)
        for element in limb.elements:
            fixed, moved = _value(element, parameters, reference)
            frame = frame @ _step(element, fixed)
            if moved is None:
                continue
            joint, start = _placed(machine, element, moved, leaders, passive, frame, link)
            if joint.mimic is None:
                home[joint.name] = start
            joints.append(joint)
            link, frame = joint.child, np.eye(4)
        end = "platform" if number == 1 else f"end{number}"
        joints.append(UrdfJoint(f"{end}_joint", "fixed", link, end, frame[:3, 3],
                                angles_of(frame[:3, :3])))  # fmt: skip
        ends.append(end)
    loops = tuple(Loop(end, ends[0], np.eye(4), np.eye(4), "fixed") for end in ends[1:])
    driven = tuple(name for (kind, _), (name, _) in leaders.items() if kind == "actuator")
    order = sorted(driven, key=[a.name for a in machine.actuators].index)
    arm = UrdfArm(machine.name, tuple(joints))
    found = Loops(ends[0], tuple(order), machine.task.coordinates, home, loops)
    return urdf_text(arm, remark, written_loops(found))


def _value(
    element: Element, parameters: Array, reference: Array
) -> tuple[float, tuple[str, int, float] | None]:
    """Fixed part of an element, and what moves it: kind, index, factor."""
    fixed, moved = element.constant, None
    for term in element.terms:
        if term.kind == "parameter":
            fixed += term.factor * float(parameters[term.index])
        else:
            moved = (str(term.kind), term.index, term.factor)
            if term.kind == "actuator":
                fixed -= term.factor * float(reference[term.index])
    return fixed, moved


def _step(element: Element, value: float) -> Array:
    along = np.zeros(3)
    along[element.axis] = value
    if element.turns:
        made = np.eye(4)
        made[:3, :3] = from_euler(*along)
        return made
    return transform(along * 1e-3, np.zeros(3))


def _placed(
    machine: Machine,
    element: Element,
    moved: tuple[str, int, float],
    leaders: dict[tuple[str, int], tuple[str, float]],
    passive: Array,
    frame: Array,
    parent: str,
) -> tuple[UrdfJoint, float]:
    """A moving joint, and its value at home, rad or m."""
    kind, index, factor = moved
    actuator = machine.actuators[index] if kind == "actuator" else None
    if actuator is not None and (
        (actuator.unit == "rad") != element.turns
        or (abs(factor) != 1.0 and (kind, index) not in leaders)
    ):
        raise BadInput(
            f"actuator {actuator.name} moves its joint through a gear or a screw; a joint of a "
            "URDF is moved by its own coordinate",
            place="--as urdf",
            remedy="Describe the machine by the joint's coordinate",
        )
    scale = 1.0 if element.turns else 1e-3
    axis, mimic = np.zeros(3), None
    own = actuator.name if actuator is not None else f"passive{index + 1}"
    value = actuator.home if actuator is not None else float(passive[index])
    if (kind, index) in leaders:
        leader, first = leaders[kind, index]
        own = f"{leader}_{parent}"
        axis[element.axis] = np.sign(first)
        mimic = (leader, float(factor / first), 0.0)
    else:
        leaders[kind, index] = (own, factor)
        axis[element.axis] = np.sign(factor)
    if actuator is not None:
        limits = tuple(sorted(scale * float(v) for v in actuator.limits))
    else:
        reach = np.pi if element.turns else 10.0
        limits = (-float(reach), float(reach))
    low, high = limits
    joint = UrdfJoint(
        own, "revolute" if element.turns else "prismatic", parent, f"link_{own}",
        frame[:3, 3], angles_of(frame[:3, :3]), axis, (low, high), mimic,
    )  # fmt: skip
    return joint, scale * value
