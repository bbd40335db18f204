"""Parallel machines from URDF: a tree, and the loops that close it (files/urdf_loops.py)."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from app.files.urdf import MOVING, UrdfJoint, angles_of, chain_of, transform
from app.files.urdf_chain import Passive, limits_of, plain, words_of
from app.files.urdf_loops import Loop, Loops
from calib.arrays import Array
from calib.errors import BadInput
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
