"""The same library of terms asked of many halves of the readings, in one pass over its columns.

A half S of the readings has its own fit: with slope J_S e_S - J e (the gradient of the part left
out, priors included) its residual is e_S - J_S^T N_S^-1 (J_S e_S - J e).
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, BoolArray
from calib.evidence.candidate import Candidate
from calib.evidence.draws import squared
from calib.evidence.problem import LinearProblem
from calib.evidence.scored import Scored
from calib.evidence.weighed import Weighed
from calib.scaled import Scaled, normal_matrix


@dataclass(eq=False, kw_only=True)
class Half(Scored):
    """Scores of a library on some of the components.

    Attributes
    ----------
    whole : LinearProblem
        The fit to all readings.
    inside : (R,) bool
        Which components are in.
    normal : Scaled
        Normal matrix (p, p) of the fit to these.
    residual : (R,)
        Of that fit; zero outside.
    taken : tuple of (m, R)
        What terms that joined have taken, orthonormal but for their priors; zero outside.
    """

    whole: LinearProblem
    inside: BoolArray
    normal: Scaled
    residual: Array
    taken: tuple[Array, ...] = ()

    def project(self, columns: Array) -> Array:
        """What of columns (m, R), zero outside, the fit to this half leaves."""
        jacobian = self.whole.jacobian
        pulled = self.normal.half_solved(jacobian @ columns.T)
        left = columns - self.inside * (self.normal.half_solved_back(pulled).T @ jacobian)
        for one in self.taken:
            left = left - (columns @ one.T) @ one
        return np.asarray(left)

    def joined(self, columns: Array, precision: Array) -> tuple["Half", Array]:
        """This half's fit with columns (m, R) too, scores of before; what they take (m, R)."""
        own = columns * self.inside
        projected = self.project(own)
        scaled = Scaled.of(own @ projected.T + np.diag(precision))
        taken = scaled.half_solved(projected)
        residual = self.residual - taken.T @ scaled.half_solved(own @ self.residual)
        more = float(np.einsum("mr,mr->", taken, taken))
        half = replace(
            self,
            residual=residual,
            taken=(*self.taken, taken),
            squares=squared(residual[:, None]),
            trace=self.trace - more,
            remembered={},
        )
        return half, taken


def halves_of(
    problem: LinearProblem,
    library: Sequence[Candidate],
    always: BoolArray,
    firsts: Sequence[BoolArray],
) -> list[Half]:
    """Halves of the readings, each with its complement behind it.

    Parameters
    ----------
    always : (R,) bool
        Components that are in every half.
    firsts : sequence of (R,) bool
        Components of a first half, without these; the others are its complement.
    """
    masks = [mask for first in firsts for mask in (first | always, ~first)]
    fits = [_fit(problem, mask) for mask in masks]
    shapes = [one.columns.shape for one in library]
    norms, weights, scores = (
        [[np.zeros((*shape[:2], *more(shape))) for shape in shapes] for _ in masks]
        for more in (lambda shape: (), lambda shape: (shape[1],), lambda shape: (1,))
    )
    residuals = np.array([residual for _, residual, _ in fits])
    for index, candidate in enumerate(library):
        for part, block in candidate.columns.blocks():
            found = block @ residuals.T
            for number, sums in enumerate(_sums(problem, block, always, firsts)):
                norm, weight = _weighed(fits[number][0], *sums)
                norms[number][index][part], weights[number][index][part] = norm, weight
                safe = np.where(norm > 0.0, norm, 1.0)[:, :, None]
                scores[number][index][part] = found[:, :, number, None] / safe
    return [
        Half(
            weighed=Weighed(library, norms[number], weights[number]),
            scores=scores[number],
            squares=squared(residual[:, None]),
            trace=trace,
            whole=problem,
            inside=masks[number],
            normal=normal,
            residual=residual,
        )
        for number, (normal, residual, trace) in enumerate(fits)
    ]


def all_joined(halves: Sequence[Half], joining: Sequence[tuple[Array, Array]]) -> list[Half]:
    """Every half with its own columns (m, R) and precision (m,) in its fit, scored anew."""
    found = [half.joined(*own) for half, own in zip(halves, joining, strict=True)]
    if not found:
        return []
    scores = [[np.empty_like(one) for one in half.scores] for half in halves]
    weights = [[np.empty_like(one) for one in half.weights] for half in halves]
    for index, candidate in enumerate(halves[0].candidates):
        for part, block in candidate.columns.blocks():
            for number, (half, taken) in enumerate(found):
                norm = half.norms[index][part]
                safe = np.where(norm > 0.0, norm, 1.0)[:, :, None]
                cross = block @ taken.T / safe
                weights[number][index][part] = half.weights[index][part] - cross @ np.swapaxes(
                    cross, 1, 2
                )
                scores[number][index][part, :, 0] = block @ half.residual / safe[:, :, 0]
    return [
        replace(
            half,
            weighed=Weighed(half.candidates, half.norms, weights[number]),
            scores=scores[number],
            remembered={},
        )
        for number, (half, _) in enumerate(found)
    ]


def _fit(problem: LinearProblem, mask: BoolArray) -> tuple[Scaled, Array, float]:
    """Normal matrix (p, p), residual (R,) and tr M of the fit to some components."""
    jacobian = problem.jacobian * mask
    seen = jacobian @ jacobian.T
    normal = Scaled.of(normal_matrix(jacobian, problem.prior_precision), least=1e-12)
    slope = jacobian @ problem.residual - problem.jacobian @ problem.residual
    step = normal.half_solved_back(normal.half_solved(slope))
    residual = mask * problem.residual - jacobian.T @ step
    held = mask if problem.live is None else mask & problem.live
    taken = float(np.trace(normal.half_solved(normal.half_solved(seen).T)))
    return normal, residual, float(held.sum()) - taken


Sums = tuple[Array, Array]
"""Columns times themselves (t, k, k), and times the fitted ones (t, k, p)."""


def _sums(
    problem: LinearProblem, block: Array, always: BoolArray, firsts: Sequence[BoolArray]
) -> list[Sums]:
    """Sums of a block (t, k, R) over each first half and its complement."""

    def over(some: BoolArray) -> Sums:
        own = block * some
        return own @ np.swapaxes(block, 1, 2), own @ problem.jacobian.T

    everything, shared = over(np.ones_like(always)), over(always)
    found: list[Sums] = []
    for first in firsts:
        own = over(first)
        found.append((own[0] + shared[0], own[1] + shared[1]))
        found.append((everything[0] - own[0], everything[1] - own[1]))
    return found


def _weighed(normal: Scaled, products: Array, along: Array) -> Sums:
    """Norms (t, k), and unit columns times M times themselves (t, k, k)."""
    norm = np.sqrt(np.maximum(np.diagonal(products, axis1=1, axis2=2), 0.0))
    safe = np.where(norm > 0.0, norm, 1.0)
    unit = along / safe[:, :, None]
    absorbed = normal.half_solved(unit.reshape(-1, along.shape[2]).T).T.reshape(along.shape)
    weight = products / safe[:, :, None] / safe[:, None, :]
    return norm, weight - absorbed @ np.swapaxes(absorbed, 1, 2)
