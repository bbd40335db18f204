"""Readings with correlated noise, turned into as many whose noise is white: L^-1 y, C = L L^T.

L^-1 is never formed. Reading by reading a Kalman filter predicts the correlated part from what came
before; what it does not predict, over its standard deviation, is white (the innovations). With the
state x = (z, u), the reading y = H x + w and the state's covariance P,

    S = H P H^T + R,    v = S^-1/2 (y - H x),    K = P H^T S^-1,    x += K (y - H x),  P -= K S K^T

and log det C is the sum of log det S (Harvey 1989, 3.4). The cost is linear in the readings.
Readings that share nothing but their visit are filtered visit by visit, all visits at once.

What hangs on how the readings were taken alone is laid out once for all sizes of the noise; the
steps themselves are in :mod:`calib.noise.filtering`.
"""

from dataclasses import replace
from functools import lru_cache

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.noise.component import Noise, Taking
from calib.noise.filtering import Filters, Layout, filters, innovations

ABREAST = 64
"""Columns that are filtered together: memory is that of so many, whatever their number."""


class Whitening:
    """What turns A readings (their three components whitened by stated sigmas) into white ones.

    Parameters
    ----------
    taking : Taking
    noise : Noise
    """

    def __init__(self, taking: Taking, noise: Noise) -> None:
        self._count = taking.run.size
        self._noise = noise
        self._own: Array | None = None
        own_log_det = 0.0
        if noise.scatter:
            root = taking.scatter.root(noise.scatter, taking.live)
            self._own = np.ascontiguousarray(np.moveaxis(np.linalg.inv(root), 0, -1))
            own_log_det = 2.0 * float(np.sum(np.log(np.diagonal(root, axis1=1, axis2=2))))
        self._plain = noise.tau_s <= 0.0 and noise.visit <= 0.0
        self._layout: Layout | None = None
        self._chain: tuple[IntArray, Array] | None = None
        if self._plain:
            self.log_det = 2.0 * float(taking.held().sum()) * float(np.log(noise.scale))
        elif noise.visit <= 0.0 and noise.share >= 1.0:
            rho = np.exp(-taking.gaps(noise.by_row) / noise.tau_s)
            left = np.sqrt(1.0 - rho**2)
            self._chain = (taking.order, rho)
            held = taking.held()[taking.order]
            self.log_det = 2.0 * float(held @ np.log(noise.scale * left))
        else:
            layout = _laid_out(taking, noise.tau_s > 0.0, noise.visit > 0.0)
            if self._own is not None and noise.visit > 0.0:
                layout = _corrected(layout, taking, self._own)
            self._layout = layout
            self._filters = _filters(taking, layout, noise)
            logs = np.log(self._filters.spread[layout.there])
            if taking.live is not None:
                logs = logs * taking.live[:, layout.reading[layout.there]].T
            self.log_det = 2.0 * float(np.sum(logs))
        self.log_det += own_log_det

    def apply(self, columns: Array) -> Array:
        """Columns (..., 3, A) of whitened components, made white; each stays in its place."""
        if self._own is not None:
            columns = _times(self._own, columns)
        if self._plain:
            return columns / self._noise.scale if self._noise.scale != 1.0 else columns
        flat = columns.reshape(-1, 3, self._count)
        if self._chain is not None:
            order, rho = self._chain
            out = np.empty_like(flat)
            before = flat[:, :, np.concatenate([order[:1], order[:-1]])]
            left = self._noise.scale * np.sqrt(1.0 - rho**2)
            out[:, :, order] = (flat[:, :, order] - rho * before) / left
            return out.reshape(columns.shape)
        assert self._layout is not None
        parts = [
            self._filtered(self._layout, flat[k : k + ABREAST])
            for k in range(0, flat.shape[0], ABREAST)
        ]
        return np.concatenate(parts).reshape(columns.shape) if parts else columns

    def _filtered(self, layout: Layout, flat: Array) -> Array:
        """Innovations of columns (k, 3, A)."""
        rows = np.ascontiguousarray(np.moveaxis(flat, 0, -1).swapaxes(0, 1))
        out = innovations(layout, self._filters, rows)
        return np.asarray(np.moveaxis(out.swapaxes(0, 1), -1, 0))


def _times(lower: Array, columns: Array) -> Array:
    """Lower triangular matrices (3, 3, A) times columns (..., 3, A)."""
    out = np.empty_like(columns)
    for row in range(3):
        out[..., row, :] = lower[row, 0] * columns[..., 0, :]
        for other in range(1, row + 1):
            out[..., row, :] += lower[row, other] * columns[..., other, :]
    return out


@lru_cache(maxsize=8)
def _laid_out(taking: Taking, ties: bool, visits: bool) -> Layout:
    """The sequences of readings, side by side."""
    sequences = _sequences(taking, taking.order, ties)
    length = np.array([one.size for one in sequences])
    place = np.arange(length.max())[:, None]
    there = place < length
    reading = np.zeros(there.shape, dtype=np.intp)
    for k, one in enumerate(sequences):
        reading[:, k] = one[np.minimum(place[:, 0], one.size - 1)]
    visit = np.where(there, taking.visit[reading], -1)
    before = np.full(visit.shape, -2)
    for step in range(1, visit.shape[0]):
        before[step] = np.where(visit[step - 1] >= 0, visit[step - 1], before[step - 1])
    first = 3 if ties else 0
    size = first + (taking.motions.shape[0] if visits else 0)
    seen = np.zeros((*there.shape, 3, size))
    seen[..., :first] = np.eye(3)[:, :first] * there[..., None, None]
    if visits:
        seen[..., first:] = _moved(taking, reading, there)
    return Layout(reading, there, (visit >= 0) & (visit != before), seen)


def _moved(taking: Taking, reading: IntArray, there: BoolArray) -> Array:
    """How actuators that do not repeat move each reading of the sequences, (T, B, 3, n)."""
    motions = taking.motions.transpose(2, 1, 0)[reading]
    return np.asarray(motions * (there & (taking.visit[reading] >= 0))[..., None, None])


def _corrected(layout: Layout, taking: Taking, inverse: Array) -> Layout:
    """The same sequences of readings that are whitened by ``inverse`` (3, 3, A) once more."""
    seen = layout.seen.copy()
    first = seen.shape[3] - taking.motions.shape[0]
    seen[..., first:] = _moved(taking.corrected(inverse), layout.reading, layout.there)
    return replace(layout, seen=seen)


def _filters(taking: Taking, layout: Layout, noise: Noise) -> Filters:
    """Run the covariances of a noise through all sequences."""
    ties = noise.tau_s > 0.0
    steps, batch, _, size = layout.seen.shape
    first = 3 if ties else 0
    variance, correlated = noise.scale**2, noise.share if ties else 0.0
    fade = np.ones((steps, batch, size))
    fresh = np.zeros((steps, batch, size))
    if ties:
        rho = np.zeros(taking.run.size)
        rho[taking.order] = np.exp(-taking.gaps(noise.by_row) / noise.tau_s)
        fade[..., :first] = rho[layout.reading][..., None]
        fresh[..., :first] = correlated * variance * (1.0 - fade[..., :first] ** 2)
    fade[..., first:][layout.new] = 0.0
    fresh[..., first:][layout.new] = noise.visit**2
    own = np.where(layout.there, (1.0 - correlated) * variance, 1.0)
    return filters(layout, fade, fresh, own)


def _sequences(taking: Taking, order: IntArray, ties: bool) -> list[IntArray]:
    """Readings that must be filtered one after the other: of a run, or of a visit."""
    if ties:
        return [order[taking.run[order] == run] for run in np.unique(taking.run)]
    own = taking.visit[order]
    alone = [order[k : k + 1] for k in np.flatnonzero(own < 0)]
    ranked = np.argsort(own, kind="stable")
    ranked = ranked[own[ranked] >= 0]
    cuts = np.flatnonzero(np.diff(own[ranked])) + 1
    return [*alone, *(order[part] for part in np.split(ranked, cuts) if part.size)]
