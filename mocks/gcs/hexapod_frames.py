"""Rigid motions as a closed hexapod writes them, and its coordinate systems.

A motion is (rotation (3, 3), place (3,) in mm). Written X, Y, Z in mm and U, V, W in degrees, it
turns about axes that move along, first x, then the new y, then the new z: Rx(U) Ry(V) Rz(W). X, Y,
Z say where the pivot c goes: place = X + c - R c.

A coordinate system of type KSD stands somewhere relative to the root, with the work and with the
tool alike: a motion M of the platform is written as S^-1 M S in the system S.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from mocks.gcs.errors import Code, GcsError
from mocks.physics.pose import Array

ROOT, ROOT_TYPE, OWN_TYPE = "ZERO", "ROOT", "KSD"
Motion = tuple[Array, Array]
STILL: Motion = (np.eye(3), np.zeros(3))


def motion_of(written: Sequence[float], pivot: Array) -> Motion:
    """The motion that is written as six numbers."""
    cu, cv, cw = np.cos(np.radians(np.asarray(written[3:], dtype=float)))
    su, sv, sw = np.sin(np.radians(np.asarray(written[3:], dtype=float)))
    first = np.array([[1.0, 0.0, 0.0], [0.0, cu, -su], [0.0, su, cu]])
    second = np.array([[cv, 0.0, sv], [0.0, 1.0, 0.0], [-sv, 0.0, cv]])
    third = np.array([[cw, -sw, 0.0], [sw, cw, 0.0], [0.0, 0.0, 1.0]])
    turn = first @ second @ third
    return turn, np.asarray(written[:3], dtype=float) + pivot - turn @ pivot


def written_as(motion: Motion, pivot: Array) -> tuple[float, ...]:
    """Six numbers of a motion."""
    turn, place = motion
    u = np.arctan2(-turn[1, 2], turn[2, 2])
    v = np.arcsin(np.clip(turn[0, 2], -1.0, 1.0))
    w = np.arctan2(-turn[0, 1], turn[0, 0])
    moved = place - pivot + turn @ pivot
    return tuple(float(x) for x in (*moved, *np.degrees([u, v, w])))


def after(a: Motion, b: Motion) -> Motion:
    """First b, then a."""
    return a[0] @ b[0], a[0] @ b[1] + a[1]


def back(motion: Motion) -> Motion:
    """Its inverse."""
    return motion[0].T, -motion[0].T @ motion[1]


@dataclass
class Systems:
    """Coordinate systems that somebody has defined, the active one, and the pivot in mm."""

    defined: dict[str, tuple[float, ...]] = field(default_factory=dict)
    active: str = ROOT
    pivot: dict[str, float] = field(default_factory=lambda: dict.fromkeys("RST", 0.0))

    @property
    def centre(self) -> Array:
        """The pivot as a vector."""
        return np.array([self.pivot[axis] for axis in "RST"])

    def _stand(self) -> Motion:
        if self.active == ROOT:
            return STILL
        return motion_of(self.defined[self.active], np.zeros(3))

    def read(self, written: Sequence[float]) -> Motion:
        """Motion of the platform that is written so in the active system."""
        stand = self._stand()
        return after(after(stand, motion_of(written, self.centre)), back(stand))

    def write(self, motion: Motion) -> tuple[float, ...]:
        """A motion of the platform, written in the active system."""
        stand = self._stand()
        return written_as(after(after(back(stand), motion), stand), self.centre)

    def define(self, name: str, offsets: Mapping[str, float], axes: str) -> None:
        """Define a system, or one that is not in use anew."""
        if name == ROOT or not name.isidentifier():
            raise GcsError(Code.NAME_OF_SYSTEM)
        if name == self.active:
            raise GcsError(Code.SYSTEM_IN_USE)
        self.defined[name] = tuple(offsets.get(axis, 0.0) for axis in axes)

    def enable(self, name: str) -> None:
        """Make a system the active one."""
        if name in (ROOT, "0"):
            self.active = ROOT
        elif name in self.defined:
            self.active = name
        else:
            raise GcsError(Code.NO_SUCH_SYSTEM)

    def enabled(self) -> dict[str, str]:
        """Name and type of what is active."""
        return {self.active: ROOT_TYPE if self.active == ROOT else OWN_TYPE}
