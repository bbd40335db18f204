"""Every hypothesis in the observed residual and in fits where nothing is missing.

Columns and null draws are taken in blocks (:mod:`calib.evidence.columns`,
:mod:`calib.evidence.draws`): what is held grows with the readings and with the number of trials,
not with their product. What scores say is :mod:`calib.evidence.scored`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from calib.arrays import Array
from calib.evidence.candidate import Candidate
from calib.evidence.columns import Room
from calib.evidence.draws import Residuals, residuals_of, squared
from calib.evidence.problem import LinearProblem
from calib.evidence.scored import Scored
from calib.evidence.weighed import Weighed
from calib.scaled import Scaled


@dataclass(eq=False, kw_only=True)
class Scores(Scored):
    """Scores with the fit that they are of.

    Attributes
    ----------
    problem : LinearProblem
    residuals : Residuals
        Observed residual first, then null draws.
    """

    problem: LinearProblem
    residuals: Residuals
    larger: "dict[int, _Larger]" = field(default_factory=dict, repr=False)
    """Larger fits that were asked for, by the candidate that joined."""

    def of_units(self, index: int, matrix: Array) -> Array:
        """Unit columns of a candidate times a matrix (R, m): (T, k, m)."""
        norm, columns = self.norms[index], self.candidates[index].columns
        parts = [_times(block, matrix, norm[part]) for part, block in columns.blocks()]
        return np.concatenate(parts)

    def without(
        self,
        columns: Array,
        precision: Array,
        rng: np.random.Generator,
        joining: int | None = None,
    ) -> "Scores":
        """Scores after ``columns`` (k, R) with prior ``precision`` (k,) have joined the fit.

        With g = (A M A^T + Lambda)^-1/2 A M the larger fit has M' = M - g^T g and
        e' = e - g^T (A M A^T + Lambda)^-1/2 (A e + Lambda^1/2 xi), xi = 0 in the observation.

        Of a candidate whose number is told in ``joining``, what does not hang on the null draws
        is remembered for the same question of more draws.
        """
        larger = self.larger.get(-1 if joining is None else joining)
        if larger is None:
            larger = self._larger(columns, precision)
            if joining is not None:
                self.larger[joining] = larger
        prior = np.sqrt(precision)[:, None] * rng.standard_normal(
            (precision.size, self.residuals.count)
        )
        prior[:, 0] = 0.0
        pulled = larger.scaled.half_solved(self.residuals.times(larger.columns) + prior)
        residuals = self.residuals.without(larger.taken, pulled)
        return Scores(
            problem=larger.problem,
            residuals=residuals,
            weighed=larger.weighed,
            scores=[
                old - cross @ pulled for old, cross in zip(self.scores, larger.crosses, strict=True)
            ],
            squares=residuals.by_draw(squared),
            trace=larger.problem.trace,
            remembered=larger.remembered,
            larger=larger.larger,
        )

    def _larger(self, columns: Array, precision: Array) -> "_Larger":
        projected = self.problem.project(columns)
        scaled = Scaled.of(columns @ projected.T + np.diag(precision))
        taken = scaled.half_solved(projected)
        crosses = [self.of_units(index, taken.T) for index in range(len(self.candidates))]
        weights = [
            weight - cross @ np.swapaxes(cross, 1, 2)
            for weight, cross in zip(self.weights, crosses, strict=True)
        ]
        return _Larger(
            columns,
            scaled,
            taken,
            crosses,
            self.problem.with_columns(columns, precision),
            Weighed(self.candidates, self.norms, weights),
        )

    def release(self) -> None:
        """Hold no more than numbers: columns and null draws are made anew if they are asked for."""
        self.weighed = Weighed(
            [replace(one, columns=one.columns.released()) for one in self.candidates],
            self.norms,
            self.weights,
        )
        self.residuals = self.residuals.released()
        self.larger = {}

    def with_more(self, draws: int, rng: np.random.Generator) -> "Scores":
        """The same with so many null draws more."""
        more = residuals_of(self.problem, draws, rng)
        scores = _scores(self.candidates, more, self.norms)
        return replace(
            self,
            residuals=self.residuals.joined(more),
            scores=[
                np.concatenate([old, new[:, :, 1:]], axis=2)
                for old, new in zip(self.scores, scores, strict=True)
            ],
            squares=np.concatenate([self.squares, more.by_draw(squared)[1:]]),
        )


@dataclass(frozen=True, eq=False)
class _Larger:
    """A fit that some columns (k, R) have joined, with what the observation says of it.

    ``taken`` (k, R) is g, ``crosses`` are unit columns of every candidate times it, (T, k', k).
    """

    columns: Array
    scaled: Scaled
    taken: Array
    crosses: list[Array]
    problem: LinearProblem
    weighed: Weighed
    remembered: dict[int, tuple[float, list[Array]]] = field(default_factory=dict)
    larger: "dict[int, _Larger]" = field(default_factory=dict)


def score(
    problem: LinearProblem, candidates: Sequence[Candidate], rng: np.random.Generator, draws: int
) -> Scores:
    """Score candidates in the observed residual and in ``draws`` fits with nothing missing."""
    room = Room()
    candidates = [replace(one, columns=room.held(one.columns)) for one in candidates]
    residuals = residuals_of(problem, draws, rng)
    norms = [np.empty(one.columns.shape[:2]) for one in candidates]
    weights = [np.empty((*one.columns.shape[:2], one.columns.shape[1])) for one in candidates]

    def weigh(index: int, part: slice, block: Array) -> None:
        norms[index][part], weights[index][part] = _weighed(problem, block)

    scores = _scores(candidates, residuals, norms, weigh)
    return Scores(
        problem=problem,
        residuals=residuals,
        weighed=Weighed(candidates, norms, weights),
        scores=scores,
        squares=residuals.by_draw(squared),
        trace=problem.trace,
    )


def _weighed(problem: LinearProblem, block: Array) -> tuple[Array, Array]:
    """Norms (t, k) of a block of columns (t, k, R), and unit columns times M times themselves."""
    products = block @ np.swapaxes(block, 1, 2)
    norm = np.sqrt(np.diagonal(products, axis1=1, axis2=2))
    absorbed = _times(block, problem.absorbed.T, norm)
    safe = np.where(norm > 0.0, norm, 1.0)
    weight = products / safe[:, :, None] / safe[:, None, :]
    return norm, weight - absorbed @ np.swapaxes(absorbed, 1, 2)


def _scores(
    candidates: Sequence[Candidate],
    residuals: Residuals,
    norms: Sequence[Array],
    before: Callable[[int, slice, Array], None] | None = None,
) -> list[Array]:
    """Unit columns of all candidates times all residuals, (T, k, 1 + draws) each.

    Blocks of draws outside, blocks of columns inside: what does not fit into the memory is made
    again for each block of draws. ``before`` sees every block of columns once, first.
    """
    found = [np.empty((*one.columns.shape[:2], residuals.count)) for one in candidates]
    for which, drawn in residuals.blocks():
        for index, candidate in enumerate(candidates):
            for part, block in candidate.columns.blocks():
                if before is not None and which.start == 0:
                    before(index, part, block)
                found[index][part, :, which] = _times(block, drawn, norms[index][part])
    return found


def _times(block: Array, matrix: Array, norm: Array) -> Array:
    """Columns (t, k, R) divided by their norms (t, k), times a matrix (R, m)."""
    product = block.reshape(-1, block.shape[2]) @ matrix
    product /= np.where(norm > 0.0, norm, 1.0).reshape(-1, 1)
    return np.asarray(product.reshape(*norm.shape, -1))
