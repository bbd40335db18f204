"""Normal equations of unknowns in many units: scaled, solved, scaled back.

A normal matrix N = J J^T + diag(precision) has entries in 1/mm^2, 1/rad^2, (N/mm)^2 ..., many
orders of magnitude apart. S N S with S = diag(N)^-1/2 has a unit diagonal and is as well
conditioned as the readings and the priors allow; with L L^T = S N S

    N^-1 = S (S N S)^-1 S,      |L^-1 S b|^2 = b^T N^-1 b.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calib.arrays import Array


def normal_matrix(columns: Array, precision: Array) -> Array:
    """Normal matrix (p, p) of derivatives (p, R) in sigmas and the priors' precision (p,)."""
    normal: Array = columns @ columns.T
    normal[np.diag_indices_from(normal)] += precision
    return normal


@dataclass(frozen=True, eq=False)
class Scaled:
    """A positive definite matrix N (p, p), scaled to a unit diagonal.

    Attributes
    ----------
    matrix : (p, p)
        S N S.
    scale : (p,)
        Diagonal of S.
    """

    matrix: Array
    scale: Array

    @classmethod
    def of(cls, normal: Array, least: float = 0.0) -> "Scaled":
        """Scale N; ``least`` joins the unit diagonal, for unknowns that nothing determines."""
        diagonal = np.diag(normal)
        scale = 1.0 / np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        matrix = normal * scale[:, None] * scale
        if least:
            matrix[np.diag_indices_from(matrix)] += least
        return cls(matrix, scale)

    def solve(self, slope: Array, damping: float = 0.0) -> Array:
        """N^-1 slope (p,); ``damping`` joins the unit diagonal."""
        damped = self.matrix + damping * np.eye(self.scale.size) if damping else self.matrix
        np.linalg.cholesky(damped)  # says if it is not positive definite
        return np.asarray(self.scale * np.linalg.solve(damped, self.scale * slope))

    def inverse(self) -> Array:
        """N^-1 (p, p)."""
        return np.asarray(np.linalg.inv(self.matrix) * self.scale[:, None] * self.scale)

    def half_solved(self, columns: Array) -> Array:
        """L^-1 S columns, (p,) or (p, m)."""
        scaled = (columns.T * self.scale).T
        return np.asarray(np.linalg.solve(self.factor, scaled))

    def half_solved_back(self, pulled: Array) -> Array:
        """S L^-T pulled, (p,) or (p, m): after :meth:`half_solved`, N^-1 of what it was given."""
        solved = np.linalg.solve(self.factor.T, pulled)
        return np.asarray((solved.T * self.scale).T)

    @cached_property
    def factor(self) -> Array:
        """L (p, p), lower triangular."""
        return np.asarray(np.linalg.cholesky(self.matrix))
