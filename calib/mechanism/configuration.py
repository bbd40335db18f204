"""A machine closed at many poses: what forward and inverse kinematics answer."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, BoolArray, IntArray, Selection
from calib.mechanism.rigid import Poses


@dataclass(frozen=True, eq=False)
class Configuration:
    """A machine closed at N poses.

    Attributes
    ----------
    poses : Poses
        Platform in the base frame.
    extension : (n, N)
        Actuator extensions s, mm or rad.
    passive : (n_joints, N)
        Passive coordinates, limb after limb, mm or rad.
    strain : tuple of (n_compliant, L, N)
        Elastic deflections, by group of limbs; empty for a rigid machine.
    converged : (N,) bool
    iterations : (N,) int
        Newton steps taken.
    conditioning : (N,)
        Smallest over largest diagonal of the triangle of the stacked rows: near zero at a
        singularity.
    """

    poses: Poses
    extension: Array
    passive: Array
    strain: tuple[Array, ...]
    converged: BoolArray
    iterations: IntArray
    conditioning: Array

    @property
    def count(self) -> int:
        """Number of poses N."""
        return self.poses.count

    def take(self, which: Selection) -> "Configuration":
        """Configurations selected by index, slice or mask."""
        return Configuration(
            self.poses.take(which),
            self.extension[:, which],
            self.passive[:, which],
            tuple(e[:, :, which] for e in self.strain),
            self.converged[which],
            self.iterations[which],
            self.conditioning[which],
        )


def joined(parts: list[Configuration]) -> Configuration:
    """Configurations of several batches as one."""
    if len(parts) == 1:
        return parts[0]
    return Configuration(
        Poses(
            np.concatenate([p.poses.position for p in parts], axis=-1),
            np.concatenate([p.poses.rotation for p in parts], axis=-1),
        ),
        np.concatenate([p.extension for p in parts], axis=-1),
        np.concatenate([p.passive for p in parts], axis=-1),
        tuple(
            np.concatenate([p.strain[g] for p in parts], axis=-1)
            for g in range(len(parts[0].strain))
        ),
        np.concatenate([p.converged for p in parts]),
        np.concatenate([p.iterations for p in parts]),
        np.concatenate([p.conditioning for p in parts]),
    )
