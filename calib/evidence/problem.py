"""A fit as the discovery core sees it: residual, derivatives and priors, all in sigmas.

Near its optimum the model reads y = J^T theta + A^T beta + eps with eps ~ N(0, I), the fitted
unknowns theta with prior precision Lambda (zero where there is no prior) and the candidate's
unknowns beta. With N = J J^T + Lambda = L L^T and G = L^-1 J the residual of the fit is

    e = M (y - f(prior mean)),      M = I - J^T N^-1 J = I - G^T G.

Under "nothing is missing" the truth is drawn from its prior and y - f has covariance
I + J^T Lambda^-1 J = M^-1 (Woodbury), so that

    e ~ N(0, M)    and    A e ~ N(A M A^T beta, A M A^T)

exactly: M is the marginal weight of the readings after geometry, frames and effects already in
have taken what they can. It is never formed; G, of p rows, stands for it.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calib.arrays import Array, BoolArray
from calib.scaled import Scaled, normal_matrix

VANISHING = 1e-10
"""Eigenvalues of the scaled J J^T below this times the largest are directions not seen at all."""


@dataclass(frozen=True, eq=False)
class LinearProblem:
    """A linearised fit of R whitened readings' components with p fitted unknowns.

    Attributes
    ----------
    residual : (R,)
        Measured minus predicted at the optimum, in sigmas.
    jacobian : (p, R)
        Derivatives of the prediction by the fitted unknowns, in sigmas per unit.
    prior_precision : (p,)
        1 / sigma^2 of the priors; zero for unknowns without one (frames).
    live : (R,) bool, optional
        Components that are held, if not all; the others are zero throughout.
    pull : (p,), optional
        Lambda times the distance of the fitted unknowns from their priors' means. Where the fit has
        settled it is J e, and taken so if it is not given.
    """

    residual: Array
    jacobian: Array
    prior_precision: Array
    live: BoolArray | None = None
    pull: Array | None = None

    def __post_init__(self) -> None:
        p, rows = self.jacobian.shape
        if self.residual.shape != (rows,) or self.prior_precision.shape != (p,):
            raise ValueError(
                f"shapes do not fit: residual {self.residual.shape}, jacobian"
                f" {self.jacobian.shape}, prior_precision {self.prior_precision.shape}"
            )

    @property
    def rows(self) -> int:
        """Number of whitened components that are held."""
        return self.residual.size if self.live is None else int(self.live.sum())

    @cached_property
    def held_back(self) -> Array:
        """What the priors pull with (p,): ``pull``, or J e."""
        return self.jacobian @ self.residual if self.pull is None else self.pull

    @cached_property
    def _normal(self) -> Scaled:
        """N, scaled to a unit diagonal."""
        # Unknowns that neither data nor prior determine must not stop the diagnosis.
        return Scaled.of(normal_matrix(self.jacobian, self.prior_precision), least=1e-12)

    @cached_property
    def absorbed(self) -> Array:
        """G (p, R): M = I - G^T G."""
        return self._normal.half_solved(self.jacobian)

    def whitened_step(self, slope: Array) -> Array:
        """L^-1 slope (p,): a step of the fitted unknowns moves the prediction by G^T times it."""
        return self._normal.half_solved(slope)

    @cached_property
    def trace(self) -> float:
        """tr M = R - tr H, the degrees of freedom left."""
        return float(self.rows - np.einsum("pr,pr->", self.absorbed, self.absorbed))

    @cached_property
    def _column_space(self) -> Array:
        """Orthonormal rows (rank, R) that span the rows of J, priors left aside."""
        size = np.sqrt(np.sum(self.jacobian**2, axis=1))
        unit = self.jacobian / np.where(size > 0.0, size, 1.0)[:, None]
        values, vectors = np.linalg.eigh(unit @ unit.T)
        seen = values > VANISHING * max(float(values[-1]), VANISHING) if values.size else values > 0
        return np.asarray((vectors[:, seen] / np.sqrt(values[seen])).T @ unit)

    def project(self, columns: Array) -> Array:
        """What of ``columns`` (..., R) is left for a candidate: columns @ M."""
        return np.asarray(columns - (columns @ self.absorbed.T) @ self.absorbed)

    def visible(self, columns: Array) -> float:
        """Norm of ``columns`` (k, R) after projecting out everything fitted, over its norm before.

        A ratio of norms, without priors: what a fit with free geometry could have absorbed is
        gone. For several columns, in units of their sizes, Frobenius norms are compared; so it is
        a property of the run, not of the noise. Answers 0 for columns that are zero.
        """
        before = float(np.sum(columns**2))
        if before == 0.0:
            return 0.0
        within = columns @ self._column_space.T
        return float(np.sqrt(max(before - float(np.sum(within**2)), 0.0) / before))

    def with_columns(self, columns: Array, precision: Array) -> "LinearProblem":
        """Let the fit take ``columns`` (k, R) too, with prior ``precision`` (k,); relinearised.

        The residual becomes that of the larger fit to first order.
        """
        projected = self.project(columns)
        weight = columns @ projected.T + np.diag(precision)
        beta = np.linalg.lstsq(weight, columns @ self.residual, rcond=1e-12)[0]
        pushed = self._normal.half_solved(self.jacobian @ (columns.T @ beta))
        moved = self._normal.half_solved_back(pushed)
        return LinearProblem(
            residual=self.residual - projected.T @ beta,
            jacobian=np.concatenate([self.jacobian, columns]),
            prior_precision=np.concatenate([self.prior_precision, precision]),
            live=self.live,
            pull=np.concatenate([self.held_back - self.prior_precision * moved, precision * beta]),
        )
