"""Joints of a URDF in the words of a machine file's chains."""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from app.files.urdf import MOVING, UrdfJoint
from calib.errors import BadInput

KEPT = 1e-12
"""Lengths in mm and angles below which an element is left out."""


def limits_of(one: UrdfJoint) -> tuple[float, float]:
    """In mm or rad; a joint that turns without end has a turn either way."""
    scale = 1.0 if MOVING[one.kind] else 1000.0
    low, high = one.limits or ((-2.0 * np.pi, 2.0 * np.pi) if MOVING[one.kind] else (-1.0, 1.0))
    return float(scale * low), float(scale * high)


def plain(text: str) -> str:
    """A text for within quotation marks."""
    return re.sub(r'["\\]', "", text)


@dataclass(frozen=True)
class Passive:
    """A joint without a drive: its name in the chain, and its value at home, mm or rad.

    ``times``: 0 where it has a coordinate of its own, else 1 or -1 times the shared one so named.
    """

    name: str
    start: float = 0.0
    times: float = 0.0

    def word(self, joint: str, sign: float) -> str:
        """The joint (Rz, say), about its axis or against it."""
        if self.times:
            return f"{joint}:{'-' if sign * self.times < 0.0 else ''}?{self.name}"
        return f"{self.name}={joint}({sign * self.start!r})"


def words_of(
    joints: Sequence[UrdfJoint],
    driven: Sequence[UrdfJoint],
    place: str,
    passive: Mapping[str, Passive] | None = None,
    named: Mapping[str, str] | None = None,
) -> list[str]:
    """The chain, a line a joint; joints that follow another name its actuator.

    ``passive`` by the names of joints without a drive; ``named`` gives a name to what stands
    behind a joint.
    """
    names = {one.name: (f"q{k}", MOVING[one.kind]) for k, one in enumerate(driven, start=1)}
    lines = []
    for one in joints:
        words = [f"t{a}:{1000.0 * v!r}" for a, v in zip("xyz", map(float, one.xyz), strict=True)
                 if abs(1000.0 * v) > KEPT]  # fmt: skip
        roll, pitch, yaw = map(float, one.rpy)
        turns = (("z", yaw), ("y", pitch), ("x", roll))
        words += [f"r{a}:{v!r}" for a, v in turns if abs(v) > KEPT]
        if passive and one.name in passive:
            words += _about(one, passive[one.name].word)
        elif one.kind in MOVING:
            words += _about(one, _driver(_drive(one, names, place)))
        if named and one.name in named:
            words[-1] = f"{named[one.name]}={words[-1]}"
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


def _driver(drive: tuple[float, str, str, float]) -> Callable[[str, float], str]:
    """The word of a driven joint, about its axis or against it."""
    factor, unit, q, offset = drive

    def word(joint: str, sign: float) -> str:
        value = q if factor * sign == 1.0 and not unit else f"{factor * sign!r}{unit}*{q}"
        return f"{joint}:{value}" + (f"{sign * offset:+.17g}" if offset else "")

    return word


def _about(one: UrdfJoint, word: Callable[[str, float], str]) -> list[str]:
    """A joint about an axis: one of the frame's own, or its z turned there and back."""
    letter = "R" if MOVING[one.kind] else "T"
    along = int(np.argmax(np.abs(one.axis)))
    if np.abs(one.axis[along]) > 1.0 - 1e-12:
        return [word(f"{letter}{'xyz'[along]}", float(np.sign(one.axis[along])))]
    x, y, z = map(float, one.axis)
    swing, lean = float(np.arctan2(y, x)), float(np.arctan2(np.hypot(x, y), z))
    there = [f"rz:{swing!r}", f"ry:{lean!r}"]
    return [*there, word(f"{letter}z", 1.0), f"ry:{-lean!r}", f"rz:{-swing!r}"]
