"""Orthogonal factorisation of many small matrices at once, component first.

A matrix (m, n, ...) is reduced by Householder reflections that act on all trailing indices
together. At 6 x 5 this is far faster than one LAPACK call a matrix and as accurate; nothing is
pivoted, so the columns must be independent (checked when a machine is loaded).
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Numbers


@dataclass(frozen=True, eq=False)
class Reflectors:
    """Q R of (m, n, ...) matrices: vectors (m - k, ...), their factors and the triangle R."""

    vectors: tuple[Numbers, ...]
    factors: tuple[Numbers, ...]
    triangle: Numbers
    """R in the upper triangle of the leading n rows, shape (m, n, ...)."""

    @property
    def rows(self) -> int:
        """Number of rows m."""
        return int(self.triangle.shape[0])

    @property
    def columns(self) -> int:
        """Number of columns n."""
        return int(self.triangle.shape[1])

    def apply_transposed(self, B: Numbers) -> Numbers:
        """Q^T B for B (m, k, ...) or (m, ...), in a new array."""
        out = np.array(np.broadcast_to(B, self._full(B)), dtype=np.result_type(B, self.triangle))
        for k, (v, factor) in enumerate(zip(self.vectors, self.factors, strict=True)):
            _reflect(out[k:], v, factor)
        return out

    def apply(self, B: Numbers) -> Numbers:
        """Q B for B (m, k, ...) or (m, ...), in place of B."""
        pairs = list(zip(self.vectors, self.factors, strict=True))
        for k in range(len(pairs) - 1, -1, -1):
            _reflect(B[k:], *pairs[k])
        return B

    def _full(self, B: Numbers) -> tuple[int, ...]:
        trailing = self.triangle.shape[2:]
        own = B.shape[: B.ndim - len(trailing)]
        return own + np.broadcast_shapes(B.shape[B.ndim - len(trailing) :], trailing)

    def null_space(self) -> Numbers:
        """Orthonormal basis (m, m - n, ...) of what is perpendicular to all columns."""
        m, n = self.rows, self.columns
        W = np.zeros((m, m - n, *self.triangle.shape[2:]), dtype=self.triangle.dtype)
        for k in range(m - n):
            W[n + k, k] = 1.0
        return self.apply(W)

    def solve_triangle(self, b: Numbers) -> Numbers:
        """R^-1 b for the leading n rows of b (m, ...) or (m, k, ...): least squares after Q^T."""
        R, n = self.triangle, self.columns
        x = np.array(b[:n])
        for k in range(n - 1, -1, -1):
            for j in range(k + 1, n):
                x[k] -= R[k, j] * x[j]
            x[k] /= R[k, k]
        return x

    def diagonal_ratio(self) -> Numbers:
        """Smallest over largest magnitude on the diagonal of R, shape (...): a rank warning."""
        diagonal = np.abs(np.stack([self.triangle[k, k] for k in range(self.columns)]))
        with np.errstate(invalid="ignore", divide="ignore"):
            ratio: Numbers = diagonal.min(axis=0) / diagonal.max(axis=0)
        return ratio


def _reflect(block: Numbers, v: Numbers, factor: Numbers) -> None:
    """Apply I - factor v v^T to the rows of ``block`` (m, ...) or (m, k, ...), in place."""
    if block.ndim == v.ndim:
        along = np.einsum("i...,i...->...", v, block)
        along *= factor
        block -= v * along
    else:
        along = np.einsum("i...,ij...->j...", v, block)
        along *= factor
        block -= v[:, None] * along


def factorise(A: Numbers) -> Reflectors:
    """Reduce A (m, n, ...) with m >= n; A is overwritten by its triangle.

    A column that is zero to rounding leaves a zero on the diagonal of R; dividing by it yields
    non-finite numbers for that matrix only.
    """
    n = A.shape[1]
    vectors, factors = [], []
    for k in range(n):
        v = A[k:, k].copy()
        square = np.einsum("i...,i...->...", v, v)
        norm = np.sqrt(square)
        signed = np.where(np.real(v[0]) < 0.0, -norm, norm)
        denominator = square + signed * v[0]
        v[0] += signed
        tiny = np.real(denominator) <= 0.0
        factor = np.where(tiny, 0.0, 1.0 / np.where(tiny, 1.0, denominator))
        if k + 1 < n:
            _reflect(A[k:, k + 1 :], v, factor)
        A[k, k] = -signed
        A[k + 1 :, k] = 0.0
        vectors.append(v)
        factors.append(factor)
    return Reflectors(tuple(vectors), tuple(factors), A)
