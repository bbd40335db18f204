"""One frame in another: rigid motions, and their fit to points.

Points are (3,) or (3, N) arrays in mm. A frame as six numbers: x, y, z, rx, ry, rz with
p_tracker = R p_base + t and R = Rz(rz) Ry(ry) Rx(rx).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import permutations

import numpy as np

from calib.arrays import Array
from calib.mechanism.rigid import Poses, to_euler


@dataclass(frozen=True, eq=False)
class Frame:
    """A rigid motion p -> ``rotation`` p + ``translation``."""

    rotation: Array
    translation: Array

    @staticmethod
    def of(numbers: Sequence[float]) -> "Frame":
        """Make a frame from x, y, z (mm), rx, ry, rz (rad)."""
        poses = Poses.from_xyz_rpy(np.array(numbers, float)[:, None])
        return Frame(poses.rotation[:, :, 0], poses.position[:, 0])

    def numbers(self) -> tuple[float, ...]:
        """Express the frame as x, y, z (mm), rx, ry, rz (rad)."""
        return (*map(float, self.translation), *map(float, to_euler(self.rotation)))

    def apply(self, points: Array) -> Array:
        """Map points (3,) or (3, N)."""
        moved: Array = self.rotation @ points
        return moved + (self.translation if points.ndim == 1 else self.translation[:, None])

    def after(self, first: "Frame") -> "Frame":
        """Apply ``first``, then this one."""
        return Frame(self.rotation @ first.rotation, self.apply(first.translation))

    def inverse(self) -> "Frame":
        """The motion back."""
        back = self.rotation.T
        return Frame(back, -back @ self.translation)


def align(points: Array, seen: Array) -> tuple[Array, Array]:
    """Rotation (3, 3) and translation (3,) that take points (3, N) to ``seen`` (3, N) best.

    The closed form is Kabsch's (Acta Cryst. A32, 1976): with centred points,
    R = U diag(1, 1, d) V^T from the singular value decomposition of sum seen points^T.
    """
    centre, seen_centre = points.mean(axis=1), seen.mean(axis=1)
    u, _, vt = np.linalg.svd((seen - seen_centre[:, None]) @ (points - centre[:, None]).T)
    rotation = u @ np.diag([1.0, 1.0, np.sign(np.linalg.det(u @ vt))]) @ vt
    return rotation, seen_centre - rotation @ centre


def fit_frame(points: Array, seen: Array) -> tuple[Frame, float]:
    """Fit seen = R points + t by least squares; both (3, N), N >= 3.

    Returns the frame and the RMS distance that is left, mm.
    """
    frame = Frame(*align(points, seen))
    left = seen - frame.apply(points)
    return frame, float(np.sqrt(np.mean(np.sum(left * left, axis=0))))


CLEARLY = 3.0
"""Times by which another assignment of labels must fit better before anybody is accused of it."""


def odd_one(points: Mapping[str, Array], seen: Mapping[str, Array], limit_mm: float) -> str:
    """The one label without which the others fit within a limit (RMS, mm); empty if none or many.

    At least four are needed: three fit one another in every case but for their distances.
    """
    labels = list(seen)
    found = []
    for left in labels if len(labels) >= 4 else ():
        rest = [label for label in labels if label != left]
        drawn = np.stack([points[label] for label in rest], axis=1)
        _, rms = fit_frame(drawn, np.stack([seen[label] for label in rest], axis=1))
        if rms <= limit_mm:
            found.append((rms, left))
    found.sort()
    alone = len(found) == 1 or (len(found) > 1 and CLEARLY * found[0][0] < found[1][0])
    return found[0][1] if alone else ""


def exchanged(
    points: Mapping[str, Array],
    seen: Mapping[str, Array],
    rms_mm: float,
    limit_mm: float = np.inf,
) -> dict[str, str]:
    """Which labels were exchanged: the assignment that fits clearly better than ``rms_mm``.

    It must fit within ``limit_mm`` too: one nest that is off makes a wrong assignment a little
    better as often as not.

    Returns seen label -> true label for those that differ; empty if none fits.
    """
    labels = list(seen)
    best: tuple[float, tuple[str, ...]] = (min(rms_mm / CLEARLY, limit_mm), tuple(labels))
    for candidate in permutations(labels):
        drawn = np.stack([points[label] for label in candidate], axis=1)
        _, rms = fit_frame(drawn, np.stack([seen[label] for label in labels], axis=1))
        best = min(best, (rms, candidate))
    return {label: true for label, true in zip(labels, best[1], strict=True) if label != true}


def nest_in_base(pose: Sequence[float], nest: Sequence[float]) -> Array:
    """Place of a platform nest in the base frame, mm, at a pose x, y, z, rx, ry, rz."""
    return Frame.of(pose).apply(np.array(nest, float))
