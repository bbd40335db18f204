"""URDF, the description of robots that ROS and simulators read, in and out.

In it lengths are m and angles rad; a joint's frame is given in its parent's by xyz and rpy with
R = Rz(yaw) Ry(pitch) Rx(roll), and the joint turns about, or slides along, an axis of that frame.
"""

import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np

from calib.arrays import Array
from calib.errors import BadInput
from calib.mechanism.rigid import from_euler
from calib.quantity import LARGEST, in_short, is_meant

MOVING = {"revolute": True, "continuous": True, "prismatic": False}
"""Kinds of joints that can be driven, and whether they turn."""
FARTHEST = 3.0
"""Lengths of the whole arm: a centre of mass farther from its joint is a slip of the file."""


@dataclass(frozen=True, eq=False)
class UrdfJoint:
    """A joint: where its frame is in the parent's (m, rad), and how it moves.

    ``kind`` is fixed or one of :data:`MOVING`; ``mimic`` (joint, multiplier, offset) where it
    follows another; ``limits`` None where it has none.
    """

    name: str
    kind: str
    parent: str
    child: str
    xyz: Array = field(default_factory=lambda: np.zeros(3))
    rpy: Array = field(default_factory=lambda: np.zeros(3))
    axis: Array = field(default_factory=lambda: np.array([1.0, 0.0, 0.0]))
    limits: tuple[float, float] | None = None
    mimic: tuple[str, float, float] | None = None


@dataclass(frozen=True, eq=False)
class UrdfMass:
    """A link's mass, kg, and its centre (3,), m, in the frame of the moving joint before it."""

    link: str
    joint: str
    kg: float
    centre: Array


@dataclass(frozen=True, eq=False)
class UrdfArm:
    """The joints from a base link to a tip link, in order; what links weigh, gears by joint."""

    name: str
    joints: tuple[UrdfJoint, ...]
    masses: tuple[UrdfMass, ...] = ()
    gears: Mapping[str, float] = field(default_factory=dict)

    @property
    def reach(self) -> float:
        """The longest that the chain can be if nothing slides, m."""
        return float(sum(np.linalg.norm(one.xyz) for one in self.joints))

    def nowhere(self, mass: UrdfMass) -> bool:
        """Whether a centre of mass is so far away that its link cannot reach there."""
        return bool(np.linalg.norm(mass.centre) > FARTHEST * max(self.reach, 0.1))


def read_urdf(text: str, source: str, base: str = "", tip: str = "") -> UrdfArm:
    """Read the chain of a URDF from ``base`` to ``tip``; from the root to the only end without.

    Raises
    ------
    BadInput
        For what is no URDF, a link that is not there, several ends, a joint that no chain can hold.
    """
    root = xml_of(text, source)
    name, joints, by_child = read_tree(root, source)
    tip = tip or _only_end(joints, by_child, source)
    chain = chain_of(by_child, joints, base, tip, source)
    return UrdfArm(name, tuple(chain), tuple(_masses(root, chain, source)), _gears(root, source))


def _masses(root: ET.Element, chain: list[UrdfJoint], source: str) -> Iterator[UrdfMass]:
    """What is inertial of the links of a chain behind its first moving joint."""
    links = {one.get("name", ""): one.find("inertial") for one in root.findall("link")}
    moving, frame = "", np.eye(4)
    for one in chain:
        moves = one.kind in MOVING
        moving, frame = (
            (one.name, np.eye(4)) if moves else (moving, frame @ transform(one.xyz, one.rpy))
        )
        inertial = links.get(one.child)
        if inertial is None or not moving:
            continue
        place = f'{source}, link "{one.child}"'
        kg = _number(_child(inertial, "mass").get("value", "0"), place)
        centre = numbers_of(_child(inertial, "origin").get("xyz", "0 0 0"), 3, place)
        if kg > 0.0:
            yield UrdfMass(one.child, moving, kg, (frame @ np.append(centre, 1.0))[:3])


def _gears(root: ET.Element, source: str) -> dict[str, float]:
    """Turns of the motor for one of the joint, where a transmission says."""
    found: dict[str, float] = {}
    for one in root.findall("transmission"):
        reduction = next(iter(one.iter("mechanicalReduction")), None)
        if reduction is not None:
            value = abs(_number(reduction.text or "", f"{source}, transmission"))
            found |= {joint.get("name", ""): value for joint in one.iter("joint") if value > 1.0}
    return found


def xml_of(text: str, source: str) -> ET.Element:
    """The root of a URDF; raises BadInput for what is none."""
    try:
        root = ET.fromstring(text.lstrip("\ufeff \t\r\n"))  # as the parsers of ROS take it
    except ET.ParseError as error:
        raise BadInput(
            f"not XML: {error}", place=source, remedy="Expand xacro first: xacro ARM.xacro"
        ) from error
    if root.tag != "robot":
        raise BadInput(f"<{root.tag}> is no robot", place=source, remedy="Name a URDF file")
    return root


def read_tree(root: ET.Element, source: str) -> tuple[str, list[UrdfJoint], dict[str, UrdfJoint]]:
    """Name, joints, and the joint of each link to its parent."""
    joints = [_joint(one, source) for one in root.findall("joint")]
    if not joints:
        raise BadInput("it has no joint", place=source, remedy="Name the URDF of a robot")
    by_child = {one.child: one for one in joints}
    if len(by_child) < len(joints):
        twice = next(o.child for o in joints if [j.child for j in joints].count(o.child) > 1)
        raise BadInput(
            f'link "{twice}" has two parents',
            place=source,
            remedy="URDF is a tree: cut the loop, and list it (--loops FILE)",
        )
    return root.get("name", "arm"), joints, by_child


def chain_of(
    by_child: dict[str, UrdfJoint], joints: list[UrdfJoint], base: str, tip: str, source: str
) -> list[UrdfJoint]:
    """Joints from one link to another, or from the root; raises BadInput where there is no way."""
    links = {one.parent for one in joints} | set(by_child)
    for name in (base, tip):
        if name and name not in links:
            raise BadInput(
                f'there is no link "{name}"',
                place=source,
                remedy=f"Links are {', '.join(sorted(links))}",
            )
    chain: list[UrdfJoint] = []
    at = tip
    while at in by_child and at != base:
        chain.insert(0, by_child[at])
        at = by_child[at].parent
        if len(chain) > len(joints):
            raise BadInput("its links form a loop", place=source, remedy="URDF is a tree")
    if base and at != base:
        raise BadInput(
            f'"{tip}" does not hang on "{base}"', place=source, remedy="Name other links"
        )
    if not any(one.kind in MOVING for one in chain):
        raise BadInput(f'nothing moves on the way to "{tip}"', place=source, remedy="Name --tip")
    return chain


def _only_end(joints: list[UrdfJoint], by_child: dict[str, UrdfJoint], source: str) -> str:
    """The end of the longest chain of moving joints; raises BadInput where two are as long."""
    parents = {one.parent for one in joints}
    moving: dict[str, int] = {}
    for end in (name for name in by_child if name not in parents):
        count, at = 0, end
        while at in by_child and count <= len(joints):
            count += by_child[at].kind in MOVING
            at = by_child[at].parent
        moving[end] = count
    most = max(moving.values(), default=0)
    ends = [name for name, count in moving.items() if count == most]
    if len(ends) != 1:
        raise BadInput(
            f"{len(ends)} ends hang on as many joints: {', '.join(ends)}",
            place=source,
            remedy=f"Name one: --tip {ends[0] if ends else 'LINK'}",
        )
    return ends[0]


def _joint(node: ET.Element, source: str) -> UrdfJoint:
    name, kind = node.get("name", ""), node.get("type", "")
    place = f'{source}, joint "{name}"'
    if kind not in (*MOVING, "fixed"):
        raise BadInput(
            f'a joint of type "{kind}" is not driven by one actuator',
            place=place,
            remedy=f"Known are fixed, {', '.join(MOVING)}",
        )
    links = {what: _child(node, what).get("link", "") for what in ("parent", "child")}
    if not all(links.values()):
        raise BadInput("it has no parent or no child", place=place, remedy="Name both links")
    origin, mimic, limit = _child(node, "origin"), node.find("mimic"), node.find("limit")
    axis = numbers_of(_child(node, "axis").get("xyz", "1 0 0"), 3, place)
    if kind in MOVING and not np.linalg.norm(axis) > 0.0:
        raise BadInput("its axis has no direction", place=place, remedy='Write <axis xyz="0 0 1"/>')
    limits = None
    if limit is not None and kind != "continuous":
        limits = (_number(limit.get("lower", "0"), place), _number(limit.get("upper", "0"), place))
        limits = limits if limits[0] < limits[1] else None
    follows = None
    if mimic is not None:
        follows = (
            mimic.get("joint", ""),
            _number(mimic.get("multiplier", "1"), place),
            _number(mimic.get("offset", "0"), place),
        )
    return UrdfJoint(
        name,
        kind,
        links["parent"],
        links["child"],
        numbers_of(origin.get("xyz", "0 0 0"), 3, place),
        numbers_of(origin.get("rpy", "0 0 0"), 3, place),
        axis / max(float(np.linalg.norm(axis)), 1e-300),
        limits,
        follows,
    )


def _child(node: ET.Element, name: str) -> ET.Element:
    found = node.find(name)
    return ET.Element(name) if found is None else found


def _number(text: str, place: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = float("nan")
    if not is_meant(value):
        raise BadInput(
            f"{in_short(text)} is not a finite number that can be meant",
            place=place,
            remedy=f"Write a number within -{LARGEST:g} and {LARGEST:g}",
        )
    return value


def numbers_of(text: str, count: int, place: str) -> Array:
    """Finite numbers (count,) of an attribute; raises BadInput naming ``place``."""
    values = [_number(word, place) for word in text.split()]
    if len(values) != count:
        what = "three numbers" if count == 3 else "a number"
        raise BadInput(
            f"{in_short(text)} is not {what}",
            place=place,
            remedy="Write x y z" if count == 3 else "Write one number",
        )
    return np.array(values)


def transform(xyz: Array, rpy: Array) -> Array:
    """Frame (4, 4) of xyz and roll, pitch, yaw."""
    made = np.eye(4)
    made[:3, :3], made[:3, 3] = from_euler(*rpy), xyz
    return made


def angles_of(rotation: Array) -> Array:
    """Roll, pitch, yaw of a rotation (3, 3); right also where pitch is 90 deg.

    Each angle is taken off before the next is read, so that what one cannot know the next holds.
    """
    level = np.hypot(rotation[0, 0], rotation[1, 0])
    yaw = float(np.arctan2(rotation[1, 0], rotation[0, 0])) if level > 1e-9 else 0.0
    rest = from_euler(*np.array([0.0, 0.0, yaw])).T @ rotation
    pitch = float(np.arctan2(-rest[2, 0], rest[0, 0]))
    rest = from_euler(*np.array([0.0, pitch, 0.0])).T @ rest
    return np.array([float(np.arctan2(rest[2, 1], rest[2, 2])), pitch, yaw])


def urdf_text(arm: UrdfArm, remark: str, more: Iterable[str] = ()) -> str:
    """A URDF of joints: links without shape or mass; ``more`` lines of XML at its end."""
    lines = ['<?xml version="1.0"?>', f"<!-- {remark.replace('--', '- -')} -->"]
    lines.append(f'<robot name="{arm.name}">')
    links = dict.fromkeys(link for one in arm.joints for link in (one.parent, one.child))
    lines += [f'  <link name="{link}"/>' for link in links]
    for one in arm.joints:
        lines += _written(one)
    return "\n".join([*lines, *more, "</robot>", ""])


def _written(one: UrdfJoint) -> Iterator[str]:
    yield f'  <joint name="{one.name}" type="{one.kind}">'
    yield f'    <parent link="{one.parent}"/>'
    yield f'    <child link="{one.child}"/>'
    yield f'    <origin xyz="{_three(one.xyz)}" rpy="{_three(one.rpy)}"/>'
    if one.kind in MOVING:
        yield f'    <axis xyz="{_three(one.axis)}"/>'
    if one.limits is not None:
        low, high = one.limits
        yield f'    <limit lower="{low!r}" upper="{high!r}" effort="0" velocity="0"/>'
    if one.mimic is not None:
        name, factor, offset = one.mimic
        yield f'    <mimic joint="{name}" multiplier="{factor!r}" offset="{offset!r}"/>'
    yield "  </joint>"


def _three(values: Array) -> str:
    return " ".join(f"{value + 0.0:.15g}" for value in values)
