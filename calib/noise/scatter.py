"""Scatter that is not the same for all readings: how much one reading's noise differs in size.

In the sigmas that it states itself, the noise of a reading has the covariance (PINT's EFAC and
EQUAD are the model)

    M = g^2 (c^2 (I - v v^T) + a^2 v v^T) + sum of s^2 S

with g the product of the ratios of the groups to which the reading belongs (its nest, instrument,
run, kind), v the unit vector of the beam among whitened axes, a and c ratios along and across it,
and S the covariance of something that is added with a size of one (white noise of a micrometre, or
of a micrometre per metre of range). All are named; ``sizes`` is a tuple of name and size. What
readings share of their noise is then counted in these corrected sigmas.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from calib.arrays import Array, BoolArray

ALONG, ACROSS = "along", "across"
ADDED, ADDED_ANGLE, RANGE = "added", "added-angle", "range"
Sizes = tuple[tuple[str, float], ...]
"""Components of scatter: name and ratio, or size."""


@dataclass(frozen=True, eq=False)
class Scatter:
    """What the scatter of A readings may hang on.

    Attributes
    ----------
    groups : mapping of str to (A,) bool
        Readings whose stated sigmas may be wrong together; the name is kind of group and label.
    beam : (3, A)
        Unit vector of the beam among whitened axes; zero where there is none.
    added : mapping of str to (3, 3, A)
        Covariance in stated sigmas of what is added with a size of one.
    """

    groups: Mapping[str, BoolArray] = field(default_factory=dict)
    beam: Array = field(default_factory=lambda: np.zeros((3, 0)))
    added: Mapping[str, Array] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all that the scatter may hang on."""
        directions = (ALONG, ACROSS) if self.beam.any() else ()
        return (*self.groups, *directions, *self.added)

    def is_added(self, name: str) -> bool:
        """Whether a component is a variance that is added; else it is a ratio."""
        return name in self.added

    def shape(self, name: str) -> Array:
        """Change of M (3, 3, A) by the variance of one component, where all else is as stated."""
        count = self.beam.shape[1]
        if name in self.added:
            return self.added[name]
        unit = np.broadcast_to(np.eye(3)[:, :, None], (3, 3, count))
        if name in self.groups:
            return np.asarray(unit * self.groups[name])
        along = self.beam[:, None] * self.beam
        across = (unit - along) * self._sighted
        return np.asarray(along if name == ALONG else across, dtype=np.float64)

    @property
    def _sighted(self) -> BoolArray:
        return np.asarray(self.beam.any(axis=0))

    def covariance(self, sizes: Sizes) -> Array:
        """M (3, 3, A)."""
        count = self.beam.shape[1]
        ratio, along, across = np.ones(count), 1.0, 1.0
        for name, size in sizes:
            if name in self.groups:
                ratio = np.where(self.groups[name], ratio * size, ratio)
            along = size if name == ALONG else along
            across = size if name == ACROSS else across
        wide = np.where(self._sighted, across, 1.0) ** 2
        total = wide * np.eye(3)[:, :, None]
        if along != across:
            total = total + (along**2 - wide) * self.beam[:, None] * self.beam
        total = ratio**2 * total
        for name, size in sizes:
            if name in self.added:
                total = total + size**2 * self.added[name]
        return np.asarray(total)

    def roots(self, sizes: Sizes, live: BoolArray | None = None) -> tuple[Array, Array]:
        """Lower triangular factors (A, 3, 3) of M, where components are held, and their inverses.

        ``live`` (3, A) says which are, if not all; the others stay as they are.
        """
        M = self.covariance(sizes)
        if live is not None:
            M = np.where(live[:, None] & live, M, np.eye(3)[:, :, None])
        root, inverse = np.zeros((2, M.shape[2], 3, 3))
        root[:, 0, 0] = a = np.sqrt(M[0, 0])
        root[:, 1, 0] = b = M[1, 0] / a
        root[:, 2, 0] = c = M[2, 0] / a
        root[:, 1, 1] = d = np.sqrt(M[1, 1] - b**2)
        root[:, 2, 1] = e = (M[2, 1] - c * b) / d
        root[:, 2, 2] = f = np.sqrt(M[2, 2] - c**2 - e**2)
        inverse[:, 0, 0], inverse[:, 1, 1], inverse[:, 2, 2] = 1.0 / a, 1.0 / d, 1.0 / f
        inverse[:, 1, 0], inverse[:, 2, 1] = -b / (a * d), -e / (d * f)
        inverse[:, 2, 0] = (b * e / d - c) / (a * f)
        return root, inverse


def blocks_left(absorbed: Array, live: BoolArray | None) -> Array:
    """Blocks (3, 3, A) of M = I - G^T G of single readings, of the components that are held.

    ``absorbed`` is G (p, 3, A), ``live`` (3, A) what is held, if not all.
    """
    left = np.eye(3)[:, :, None] - np.einsum("pin,pjn->ijn", absorbed, absorbed)
    return np.asarray(left if live is None else left * (live[:, None] & live))


def uneven(
    residual: Array,
    absorbed: Array,
    scatter: Scatter,
    names: Sequence[str],
    live: BoolArray | None = None,
) -> Array:
    """How far (k,) the scatter of a fit hangs on each component, in standard deviations.

    The score test of heteroscedasticity, freed of the overall scale and studentised, so that heavy
    tails are not taken for it (Breusch and Pagan 1979, Koenker 1981). Its blocks of M = I - G^T G
    are those of single readings.

    Parameters
    ----------
    residual : (3, A)
        Residuals, made white by the noise so far.
    absorbed : (p, 3, A)
        G of the same readings (see :class:`calib.evidence.problem.LinearProblem`).
    live : (3, A) bool, optional
        Components that are held, if not all.
    """
    left = blocks_left(absorbed, live)
    freedom = float(np.einsum("iin->", left))
    square = np.sum(residual**2, axis=0)
    if freedom <= 0.0 or not square.any():
        return np.zeros(len(names))
    size = float(np.sum(square)) / freedom
    found = np.zeros(len(names))
    for k, name in enumerate(names):
        shape = scatter.shape(name)
        weight = np.einsum("ijn,jin->n", shape, left)
        shape = shape - np.sum(weight) / freedom * np.eye(3)[:, :, None]
        seen = np.einsum("in,ijn,jn->", residual, shape, residual)
        both = np.einsum("ijn,jkn->ikn", shape, left)
        spread = 2.0 * float(np.einsum("ijn,jin->", both, both))
        if spread > 1e-9:
            found[k] = float(seen) / size / np.sqrt(spread)
    return np.asarray(found / np.sqrt(tails(residual)))


def tails(residual: Array) -> float:
    """Variance of the squares of whitened residuals (3, A) over that of normal ones, at least 1."""
    own = residual[residual != 0.0]
    if own.size < 2:
        return 1.0
    return max(1.0, 0.5 * (float(np.mean(own**4) / np.mean(own**2) ** 2) - 1.0))
