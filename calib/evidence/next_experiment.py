"""Which measurements would decide between two hypotheses: T-optimal choice, one after the other.

Suppose A is true with its estimated size, so that the readings contain a = A^T beta. A fit that
believes in B instead (and in geometry, frames, what is in already: together N, prior precision
Lambda) still leaves

    delta_A = min_x |a - N^T x|^2 + x^T Lambda x ,

the non-centrality by which A is told from B (Atkinson and Fedorov 1975, T-optimality). With
P = (N N^T + Lambda)^-1 and x at its minimum, one more block of readings (N_c, a_c) adds

    r^T (I + N_c^T P N_c)^-1 r ,     r = a_c - N_c^T x ,

which is what greedy choice maximises, for the worse of "A is true" and "B is true". Without a
rival, delta is that of A against nothing: Ds-optimality for a known direction.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.scaled import Scaled, normal_matrix


class Separation:
    """How far a hypothesis stands from a fit that does not have it, reading by reading.

    Parameters
    ----------
    nuisance : (n, R)
        Whitened columns of everything the other side may fit, for the readings there are.
    precision : (n,)
        Prior precision of those unknowns.
    signature : (R,)
        Whitened displacement by the hypothesis at its estimated size.
    """

    def __init__(self, nuisance: Array, precision: Array, signature: Array) -> None:
        self._P = Scaled.of(normal_matrix(nuisance, precision), least=1e-10).inverse()
        slope = nuisance @ signature
        self._x: Array = self._P @ slope
        self.delta = max(float(signature @ signature) - float(slope @ self._x), 0.0)

    def gains(self, nuisance: Array, signature: Array) -> Array:
        """Rise of ``delta`` (C,) by each of C blocks: nuisance (C, n, m), signature (C, m)."""
        left = signature - np.einsum("cnm,n->cm", nuisance, self._x)
        spread = np.swapaxes(nuisance, 1, 2) @ (self._P @ nuisance)
        spread += np.eye(spread.shape[-1])
        return np.asarray(np.einsum("cm,cm->c", left, _solve(spread, left)))

    def add(self, nuisance: Array, signature: Array) -> None:
        """Measure one block: nuisance (n, m), signature (m,)."""
        self.delta += float(self.gains(nuisance[None], signature[None])[0])
        reach = self._P @ nuisance
        left = signature - nuisance.T @ self._x
        inverse = np.linalg.inv(np.eye(left.size) + nuisance.T @ reach)
        self._x = self._x + reach @ (inverse @ left)
        self._P = self._P - reach @ inverse @ reach.T


def _solve(matrices: Array, vectors: Array) -> Array:
    return np.asarray(np.linalg.solve(matrices, vectors[..., None])[..., 0])


@dataclass(frozen=True, eq=False)
class CandidateBlocks:
    """C candidate blocks of m readings' components for one hypothesis.

    ``nuisance`` (C, n, m) of the other side, ``signature`` (C, m) of the hypothesis.
    """

    nuisance: Array
    signature: Array


def choose_sequence(
    sides: Sequence[Separation],
    offer: Callable[[list[int]], Sequence[CandidateBlocks]],
    count: int,
) -> list[int]:
    """Choose ``count`` blocks one after the other; each may be chosen once.

    Parameters
    ----------
    sides : sequence of Separation
        "A is true" and "B is true"; the smaller delta is raised. They are updated.
    offer : callable
        For what has been chosen so far (indices in order) the candidate blocks of each side: what
        a pose shows may depend on where the machine comes from.
    count : int
        How many.
    """
    chosen: list[int] = []
    while len(chosen) < count:
        blocks = offer(chosen)
        reached = np.array(
            [
                side.delta + side.gains(b.nuisance, b.signature)
                for side, b in zip(sides, blocks, strict=True)
            ]
        )
        worth = reached.min(axis=0) + 1e-3 * reached.max(axis=0)
        worth[chosen] = -np.inf
        best = int(np.argmax(worth))
        if not np.isfinite(worth[best]):
            break
        for side, block in zip(sides, blocks, strict=True):
            side.add(block.nuisance[best], block.signature[best])
        chosen.append(best)
    return chosen
