"""What errors a machine could have that its parameters cannot imitate.

A joint stands where it stands, and turns about the axis that it has: each leaves six errors between
its own frame and the next, three places and three directions. Put into the chain behind every
joint, their columns of the pose Jacobian are compared with those of the parameters that the file
has, and of the base frame, which every calibration finds as well. What is left of a column is what
no parameter imitates; the largest rest first is taken into the file, until none is left.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array

IMITATED = 1e-6
"""Part of a column below which the others imitate it."""
ALIKE = 1e-6
"""Difference of two rests below which it is the later joint that is named."""


@dataclass(frozen=True, eq=False)
class Lacking:
    """Errors beyond a file's parameters: which of the candidates, in order, and what each adds.

    ``beyond`` are RMS rests of their columns, in the unit of the columns, when each was taken.
    ``rank_before`` and ``rank_after`` count independent columns without the base frame's.
    """

    chosen: tuple[int, ...]
    beyond: tuple[float, ...]
    rank_before: int
    rank_after: int


def lacking(
    known: Array,
    frame: Array,
    candidates: Sequence[Array],
    first: Sequence[bool],
    least: float = 0.0,
) -> Lacking:
    """Take candidates until the others imitate all that is left.

    Parameters
    ----------
    known : (p, rows)
        Columns of the file's parameters, each for an error of its usual size.
    frame : (6, rows)
        Columns of the base frame.
    candidates : sequence of (limbs, rows)
        Each candidate with the columns of all limbs that would have it.
    first : sequence of bool
        Candidates that are taken before any other: a place is easier measured than a direction.
    least : float
        RMS rest below which a candidate is not worth having, in the unit of the columns.
    """
    basis = _basis(np.zeros((0, known.shape[1])), frame)
    frames = basis.shape[0]
    basis = _basis(basis, known)
    before = basis.shape[0] - frames
    chosen: list[int] = []
    beyond: list[float] = []
    while True:
        rests = [_rest(basis, columns) for columns in candidates]
        sizes = np.array([float(np.sqrt(np.sum(r**2) / known.shape[1])) for r in rests])
        sizes = np.where(sizes > least, sizes, 0.0)
        if not sizes.size or sizes.max() == 0.0:
            break
        preferred = sizes * np.asarray(first, dtype=float)
        sizes = preferred if preferred.max() > 0.0 else sizes
        best = int(np.flatnonzero(sizes > (1.0 - ALIKE) * sizes.max())[-1])
        chosen.append(best)
        beyond.append(float(sizes[best]))
        basis = _basis(basis, candidates[best])
    return Lacking(tuple(chosen), tuple(beyond), before, basis.shape[0] - frames)


def _rest(basis: Array, columns: Array) -> Array:
    """What a basis (b, rows) does not imitate of columns (k, rows); zero where that is rounding."""
    rest = columns - (columns @ basis.T) @ basis
    rest = rest - (rest @ basis.T) @ basis
    size, whole = np.linalg.norm(rest, axis=1), np.linalg.norm(columns, axis=1)
    return np.where((size > IMITATED * whole)[:, None], rest, 0.0)


def _basis(basis: Array, columns: Array) -> Array:
    """An orthonormal basis with columns joined, those that are imitated left out."""
    for column in columns:
        rest = _rest(basis, column[None])[0]
        size = float(np.linalg.norm(rest))
        if size > 0.0:
            basis = np.vstack([basis, rest / size])
    return basis
