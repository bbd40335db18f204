"""Residuals of a fit and of fits in which nothing is missing, a few draws at a time.

A null draw is e = n - G^T g: noise n of R numbers, and what the fit makes of it, g of p numbers.
What a larger fit takes besides is of the same form. Only the small parts are held; noise is drawn
anew from the state of its generator where it would fill the memory, the same numbers each time.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array
from calib.evidence.problem import LinearProblem

HELD = 2_000_000
"""Numbers of noise that are held (16 MB)."""
BLOCK = 4_000_000
"""Numbers in a block of draws, unless a hundred draws have more."""
LEAST = 100
"""Draws in a block at least: so the number of blocks does not grow with the readings."""
ROWS = 500_000
"""Numbers that are drawn at once."""


@dataclass(frozen=True, eq=False)
class _Noise:
    """Standard normal numbers (R, draws), held or drawn anew."""

    rows: int
    draws: int
    generator: np.random.Generator
    live: Array | None
    array: Array | None

    @classmethod
    def drawn(cls, rows: int, draws: int, rng: np.random.Generator, live: Array | None) -> "_Noise":
        """Take them from a generator, which goes on behind them."""
        own = _copy(rng)
        if rows * draws <= HELD:
            array = rng.standard_normal((rows, draws))
            if live is not None:
                array *= live[:, None]
            return cls(rows, draws, own, live, array)
        for part in parts(rows, draws):
            rng.standard_normal((part.stop - part.start, draws))  # the generator goes on
        return cls(rows, draws, own, live, None)

    def put(self, first: int, last: int, where: Array) -> None:
        """Put draws first..last - 1 into ``where`` (R, last - first)."""
        for part, drawn in self._drawn():
            where[part] = drawn[:, first:last]

    def times(self, columns: Array) -> Array:
        """Columns (m, R) times all of them, (m, draws)."""
        total = np.zeros((columns.shape[0], self.draws))
        for part, drawn in self._drawn():
            total += columns[:, part] @ drawn
        return total

    def _drawn(self) -> Iterator[tuple[slice, Array]]:
        """All draws of some rows at a time, (r, draws)."""
        if self.array is not None:
            yield slice(0, self.rows), self.array
            return
        rng = _copy(self.generator)
        for part in parts(self.rows, self.draws):
            drawn = rng.standard_normal((part.stop - part.start, self.draws))
            yield part, drawn if self.live is None else drawn * self.live[part, None]


@dataclass(frozen=True, eq=False)
class Residuals:
    """The observed residual (draw 0) and null draws, R components each.

    Attributes
    ----------
    observed : (R,)
    """

    observed: Array
    _noises: tuple[_Noise, ...] = ()
    _taken: tuple[tuple[Array, Array], ...] = ()
    """Rows (m, R), and what of them is taken off each draw (m, 1 + draws)."""

    @property
    def count(self) -> int:
        """Draws, the observation counted."""
        return 1 + sum(noise.draws for noise in self._noises)

    def blocks(self) -> Iterator[tuple[slice, Array]]:
        """Which draws, and their residuals (R, d); the observation stands with the first."""
        at, before = 1, self.observed[:, None]
        for noise in self._noises:
            each = _each(noise.rows)
            for first in range(0, noise.draws, each):
                last = min(first + each, noise.draws)
                which = slice(at + first, at + last)
                found = np.empty((noise.rows, before.shape[1] + last - first))
                found[:, : before.shape[1]] = before
                drawn = found[:, before.shape[1] :]
                noise.put(first, last, drawn)
                self._take_off(which, drawn)
                if before.size:
                    which, before = slice(0, which.stop), before[:, :0]
                yield which, found
            at += noise.draws
        if before.size:
            yield slice(0, 1), before

    def _take_off(self, which: slice, drawn: Array) -> None:
        """What was taken off some draws (R, d), in place, a part of the rows at a time."""
        for part in parts(*drawn.shape):
            for rows, pulls in self._taken:
                drawn[part] -= rows[:, part].T @ pulls[:, which]

    def by_draw(self, ask: Callable[[Array], Array]) -> Array:
        """What ``ask`` answers, (..., d), of residuals (R, d), over all draws (..., 1 + draws)."""
        return np.concatenate([ask(block) for _, block in self.blocks()], axis=-1)

    def times(self, columns: Array) -> Array:
        """Columns (m, R) times all residuals, (m, 1 + draws)."""
        return self.by_draw(lambda block: columns @ block)

    def without(self, rows: Array, pulls: Array) -> "Residuals":
        """The same less rows (m, R) times what is pulled of each draw (m, 1 + draws)."""
        return replace(
            self,
            observed=self.observed - rows.T @ pulls[:, 0],
            _taken=(*self._taken, (rows, pulls)),
        )

    def joined(self, other: "Residuals") -> "Residuals":
        """With the null draws of another behind one's own."""
        count = self.count + other.count - 1
        taken = []
        for one, first in ((self, 1), (other, self.count)):
            for rows, pulls in one._taken:
                wide = np.zeros((pulls.shape[0], count))
                wide[:, first : first + one.count - 1] = pulls[:, 1:]
                taken.append((rows, wide))
        return Residuals(self.observed, (*self._noises, *other._noises), tuple(taken))

    def released(self) -> "Residuals":
        """The same, its noise drawn anew whenever it is asked for."""
        return replace(self, _noises=tuple(replace(one, array=None) for one in self._noises))

    def array(self) -> Array:
        """All at once, (R, 1 + draws)."""
        return self.by_draw(lambda block: block)


def residuals_of(problem: LinearProblem, draws: int, rng: np.random.Generator) -> Residuals:
    """The residual of a fit, and ``draws`` of fits in which nothing is missing, e ~ N(0, M).

    By perturbation: e = eps - J^T N^-1 (J eps + Lambda^1/2 xi), whose covariance is
    I - 2 J^T N^-1 J + J^T N^-1 N N^-1 J = M.
    """
    live = None if problem.live is None else problem.live.astype(np.float64)
    noise = _Noise.drawn(problem.residual.size, draws, rng, live)
    prior = np.sqrt(problem.prior_precision)[:, None] * rng.standard_normal(
        (problem.prior_precision.size, draws)
    )
    pulled = np.zeros((problem.prior_precision.size, 1 + draws))
    pulled[:, 1:] = noise.times(problem.absorbed) + problem.whitened_step(prior)
    return Residuals(problem.residual, (noise,), ((problem.absorbed, pulled),))


def squared(residuals: Array) -> Array:
    """|e|^2 (d,) of residuals (R, d)."""
    return np.asarray(np.einsum("rd,rd->d", residuals, residuals))


def _copy(rng: np.random.Generator) -> np.random.Generator:
    """A generator that gives the numbers that ``rng`` will give."""
    bits = type(rng.bit_generator)()
    bits.state = rng.bit_generator.state
    return np.random.Generator(bits)


def parts(rows: int, draws: int) -> Iterator[slice]:
    """Rows of so many numbers each, a part at a time."""
    each = max(1, ROWS // max(draws, 1))
    for first in range(0, rows, each):
        yield slice(first, min(first + each, rows))


def _each(rows: int) -> int:
    """Draws in a block."""
    return max(LEAST, BLOCK // max(rows, 1))
