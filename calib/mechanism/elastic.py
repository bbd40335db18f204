"""How the rows of an over-constrained closure share what does not fit.

A limb that is moved by ``twist`` along its wrenches W carries the wrench W lambda with
G lambda = W^T twist, G = W^T C W, C the compliances of its elements. With G = L L^T the rows
L^-1 W^T make plain least squares the elastic equilibrium of all limbs (docs/derivation.md).
A released limb keeps only the rows on which its actuators work; rows with published weights are
unit forces (Zhang et al. 2018, eq. 20).

Small systems, component first, limb and pose last; analytic throughout (complex step).
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Numbers
from calib.mechanism.householder import factorise


@dataclass(frozen=True, eq=False)
class RowWeights:
    """From the wrenches of a group of limbs to its rows of the closure.

    ``triangle`` L (m, m, L, N) or None for rows that are not whitened; ``kept`` (m, k, L, N): the
    combinations that remain, or None where all do.
    """

    triangle: Numbers | None
    kept: Numbers | None

    def apply(self, values: Numbers) -> Numbers:
        """Rows (k, ..., L, N) of what is given along the wrenches, ``values`` (m, ..., L, N)."""
        if self.triangle is not None:
            values = forward_substitution(self.triangle, values)
        if self.kept is not None:
            values = np.einsum("mkln,m...ln->k...ln", self.kept, values)
        return values


def cholesky(G: Numbers) -> Numbers:
    """Lower triangle L of G = L L^T, shape (m, m, L, N)."""
    L = np.zeros_like(G)
    for i in range(G.shape[0]):
        for j in range(i + 1):
            rest = G[i, j] - sum(L[i, k] * L[j, k] for k in range(j))
            L[i, j] = np.sqrt(rest) if i == j else rest / L[j, j]
    return L


def forward_substitution(L: Numbers, b: Numbers) -> Numbers:
    """L^-1 b for L (m, m, L, N) and b (m, ..., L, N)."""
    x = np.array(b)
    for i in range(L.shape[0]):
        for k in range(i):
            x[i] -= L[i, k] * x[k]
        x[i] /= L[i, i]
    return x


def backward_substitution(L: Numbers, b: Numbers) -> Numbers:
    """L^-T b for L (m, m, L, N) and b (m, ..., L, N)."""
    x, m = np.array(b), L.shape[0]
    for i in range(m - 1, -1, -1):
        for k in range(i + 1, m):
            x[i] -= L[k, i] * x[k]
        x[i] /= L[i, i]
    return x


def driven_rows(answers: Numbers) -> Numbers:
    """Orthonormal combinations (m, k, L, N) of the rows on which k actuators work.

    ``answers`` (m, k, L, N) are the whitened rows' answers to the actuators. What is left out is
    the limb's constraint: in that direction its compliant joint is free.
    """
    m, k = answers.shape[:2]
    first = np.zeros((m, k, *answers.shape[2:]), dtype=answers.dtype)
    for j in range(k):
        first[j, j] = 1.0
    return factorise(np.array(answers)).apply(first)


def unit_force(wrenches: Numbers, idle: Numbers | None, size: float) -> Numbers:
    """Combination (m, L, N) of wrenches W (6, m, L, N) that is a unit force.

    ``idle`` (m, m - 1, L, N): answers of the wrenches to what it does no work on.
    """
    if idle is None:
        u = np.ones((1, *wrenches.shape[2:]), dtype=wrenches.dtype)
    else:
        u = factorise(np.array(idle)).null_space()[:, 0]
    force = np.einsum("imln,mln->iln", wrenches[:3], u) / size
    unit: Numbers = u / np.sqrt(np.einsum("iln,iln->ln", force, force))
    return unit
