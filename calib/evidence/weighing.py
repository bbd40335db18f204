"""Hypotheses whitened: from scores with covariance V to the fall of chi-square by each.

For a hypothesis with scores s ~ N(V beta, V) the vector a = V^-1/2 s has unit covariance, and |a|^2
is the fall of chi-square if the hypothesis joined the fit. Hypotheses of equally many unknowns are
whitened together, over all trials at once.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calib.arrays import Array, BoolArray, IntArray

BLIND = 1e-8
"""Directions of which less than this (squared norm after / before projection) is left are lost."""
WELL_SEEN = 1e-3
"""Of each direction at least this much (squared) is left: none can be lost, triangles will do."""


@dataclass(frozen=True, eq=False)
class Weighing:
    """Whitening of one hypothesis at every trial: a = whiten @ s.

    ``whiten`` (T, k, k), rows of directions that are not seen are zero; ``dof`` (T,).
    """

    subset: tuple[int, ...]
    whiten: Array
    dof: Array


@dataclass(frozen=True, eq=False)
class Stack:
    """H hypotheses of k unknowns: ``chosen`` (H, k), ``whiten`` (H, T, k, k), ``dof`` (H, T)."""

    chosen: IntArray
    whiten: Array
    dof: Array

    def chi_squares(self, scores: Array) -> Array:
        """Fall of chi-square (H T, D), from the candidate's scores (T, K, D)."""
        everything = self.chosen.shape == (1, scores.shape[1])
        picked = scores[None] if everything else scores[:, self.chosen].swapaxes(0, 1)
        if self.chosen.shape[1] == 1:
            squared = (self.whiten[..., 0] * picked[:, :, 0]) ** 2
        else:
            whitened = self.whiten @ picked
            squared = np.einsum("htkd,htkd->htd", whitened, whitened)
        return np.asarray(squared.reshape(-1, scores.shape[2]))

    def largest(self, scores: Array) -> Iterator[tuple[float, Array]]:
        """Largest fall (D,) over hypotheses and trials of equal degrees of freedom, with these."""
        if self._freedoms:
            chi2 = self.chi_squares(scores)
            for dof, which in self._freedoms:
                yield dof, (chi2 if which is None else chi2[which]).max(axis=0)

    @cached_property
    def _freedoms(self) -> list[tuple[float, BoolArray | None]]:
        """Degrees of freedom, and which rows of :meth:`chi_squares` have them; None for all."""
        freedom = self.dof.reshape(-1)
        each = [float(dof) for dof in np.unique(freedom)]
        if len(each) == 1:
            return [(each[0], None)] if each[0] else []
        return [(dof, freedom == dof) for dof in each if dof]

    def weighing(self, row: int) -> Weighing:
        """One of the hypotheses."""
        return Weighing(tuple(map(int, self.chosen[row])), self.whiten[row], self.dof[row])


def stacked(weight: Array, chosen: IntArray) -> Stack:
    """V^-1/2 of hypotheses (H, k) at every trial, from weights (T, K, K); unseen ones dropped."""
    count = chosen.shape[1]
    if count == 1:
        values = weight[:, chosen[:, 0], chosen[:, 0]].T[:, :, None]
        seen = values > BLIND
        inverse = np.where(seen, 1.0 / np.sqrt(np.where(seen, values, 1.0)), 0.0)
        return Stack(chosen, inverse[..., None], seen.sum(axis=2))
    blocks = weight[:, chosen[:, :, None], chosen[:, None, :]].swapaxes(0, 1)
    if (whiten := _triangular(blocks)) is not None:
        return Stack(chosen, whiten, np.full(blocks.shape[:2], count))
    values, vectors = np.linalg.eigh(blocks)
    seen = values > BLIND * count
    inverse = np.where(seen, 1.0 / np.sqrt(np.where(seen, values, 1.0)), 0.0)[..., None]
    return Stack(chosen, np.swapaxes(vectors, -1, -2) * inverse, seen.sum(axis=2))


def _triangular(blocks: Array) -> Array | None:
    """Inverse Cholesky factors of (..., k, k); None if any has a direction that is hardly seen."""
    try:
        factors = np.linalg.cholesky(blocks)
    except np.linalg.LinAlgError:
        return None
    smallest = float(np.diagonal(factors, axis1=-2, axis2=-1).min())
    return np.linalg.inv(factors) if smallest**2 > WELL_SEEN else None


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Unknowns of standard deviation ``size`` (..., k) = D: D V D in its eigenvectors.

    ``values`` (..., k), ascending, are the variances that the readings see; ``vectors``
    (..., k, k) in columns.
    """

    size: Array
    values: Array
    vectors: Array


def spectrum_of(weight: Array, size: Array) -> Spectrum:
    """Spectrum of weights (..., k, k) and sizes (..., k)."""
    scaled = weight * size[..., :, None] * size[..., None, :]
    if size.shape[-1] == 1:
        return Spectrum(size, scaled[..., 0], np.ones_like(scaled))
    return Spectrum(size, *np.linalg.eigh(scaled))


def soft_test(spectrum: Spectrum) -> Stack:
    """The whole group, each direction weighed by how far its unknowns would move the readings.

    The readings see variances v, the eigenvalues of D V D; the most powerful test for such a group
    is sum w a^2, w = v / (1 + v). Under the null that is near to g times a chi-square with h
    degrees of freedom, g = sum w^2 / sum w, h = (sum w)^2 / sum w^2 (Satterthwaite 1946); it is
    divided by g here, and ``dof`` is h.
    """
    size, values, vectors = spectrum.size, spectrum.values, spectrum.vectors
    seen = values > BLIND * np.maximum(values[:, -1:], 1e-300)
    known = np.where(seen, values, 1.0)
    worth = np.where(seen, known / (1.0 + known), 0.0)
    total, squared = worth.sum(axis=1), np.maximum(np.sum(worth**2, axis=1), 1e-300)
    scale = np.sqrt(worth * (total / squared)[:, None] / known)
    whiten = np.swapaxes(vectors * size[:, :, None], 1, 2) * scale[:, :, None]
    whole = np.arange(size.shape[1], dtype=np.intp)[None]
    return Stack(whole, whiten[None], np.round(4.0 * total**2 / squared)[None] / 4.0)


def chi_squares(weighing: Weighing, scores: Array) -> Array:
    """Fall of chi-square (T, D) by a hypothesis, from its candidate's scores (T, k, D)."""
    whitened = weighing.whiten @ scores[:, list(weighing.subset)]
    return np.asarray(np.einsum("tkd,tkd->td", whitened, whitened))
