"""Structure that no smooth function shows: neighbours in time alike, poses that move as one.

Both are ratios of quadratic forms in the residual, so that a wrong sigma alone moves neither.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, IntArray
from calib.chance import log_normal_below
from calib.evidence.draws import Residuals, parts, squared
from calib.evidence.tails import log_tail


@dataclass(frozen=True, eq=False)
class Neighbours:
    """Do components that follow each other in time err alike? sum e_before e_after / sum e^2."""

    before: IntArray
    after: IntArray
    channel: str = "time_s"

    def level(self, residuals: Residuals) -> Array:
        """-log p (1 + draws,), observation first."""
        ratio = residuals.by_draw(self._ratio)
        null = ratio[1:]
        return -log_normal_below((null.mean() - ratio) / null.std())

    def _ratio(self, residuals: Array) -> Array:
        product = np.zeros(residuals.shape[1])
        for part in parts(self.before.size, residuals.shape[1]):
            before, after = residuals[self.before[part]], residuals[self.after[part]]
            product += np.einsum("pd,pd->d", before, after)
        return np.asarray(product / squared(residuals))


@dataclass(frozen=True, eq=False)
class RigidBlocks:
    """Is more of the residual in given subspaces than noise would put there?

    ``members`` (B, m) indices of components of each block (one pose, several nests) and ``bases``
    (B, k, m) orthonormal motions of the block as a whole; sum |basis e|^2 / sum e^2, referred to
    the chi-square with the mean and variance of the null draws (Satterthwaite 1946).
    """

    members: IntArray
    bases: Array
    channel: str = "pose"

    def level(self, residuals: Residuals) -> Array:
        """-log p (1 + draws,), observation first."""
        ratio = residuals.by_draw(self._ratio)
        null = ratio[1:]
        dof = max(1, int(2.0 * null.mean() ** 2 / null.var()))
        return -log_tail(ratio * dof / null.mean(), dof)

    def _ratio(self, residuals: Array) -> Array:
        total = np.zeros(residuals.shape[1])
        for part in parts(self.members.shape[0], self.members.shape[1] * residuals.shape[1]):
            within = self.bases[part] @ residuals[self.members[part]]
            total += np.einsum("bkd,bkd->d", within, within)
        return np.asarray(total / squared(residuals))


Quadratic = Neighbours | RigidBlocks


def rigid_blocks(labels: Sequence[object], columns: Array) -> RigidBlocks | None:
    """Blocks of components with the same label, moving along ``columns``.

    Parameters
    ----------
    labels : sequence of R labels
        Pose of each component; empty or None belongs to no block.
    columns : (k, R)
        Whitened rigid motions (three shifts, three turns of the platform).

    Only the blocks of the most frequent size are taken, and those of more components than
    motions; None if there are fewer than three.
    """
    groups: dict[object, list[int]] = {}
    for index, label in enumerate(labels):
        if label not in ("", None):
            groups.setdefault(label, []).append(index)
    sizes = [len(group) for group in groups.values() if len(group) > columns.shape[0]]
    if not sizes:
        return None
    usual = max(set(sizes), key=sizes.count)
    members = np.array([group for group in groups.values() if len(group) == usual], dtype=np.intp)
    if members.shape[0] < 3:
        return None
    motions = np.moveaxis(columns[:, members], 0, -1)
    bases = np.swapaxes(np.linalg.qr(motions)[0], 1, 2)
    return RigidBlocks(members, bases)
