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
from functools import cached_property, lru_cache

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.noise.component import Noise, Taking
from calib.noise.filtering import (
    Filters,
    Layout,
    Sizes,
    filters,
    in_one_pass,
    innovations,
    products,
)

ABREAST = 64
"""Columns that are filtered together: memory is that of so many, whatever their number."""
TOGETHER = 128
"""Readings that are taken together: what is between is not written to the memory and read again."""


class Whitening:
    """What turns A readings (their three components whitened by stated sigmas) into white ones.

    Parameters
    ----------
    taking : Taking
    noise : Noise
    """

    def __init__(self, taking: Taking, noise: Noise) -> None:
        self._taking, self._noise = taking, noise
        self._roots = taking.scatter.roots(noise.scatter, taking.live) if noise.scatter else None
        self._plain = noise.tau_s <= 0.0 and noise.visit <= 0.0
        self._chained = not self._plain and noise.visit <= 0.0 and noise.share >= 1.0

    @cached_property
    def log_det(self) -> float:
        """log det C, of the components that are held."""
        if self._plain:
            return self._log_own + 2.0 * float(
                self._taking.held().sum() * np.log(self._noise.scale)
            )
        if self._chained:
            held = self._taking.held()[self._taking.order]
            left = np.sqrt(1.0 - self._rho**2)
            return self._log_own + 2.0 * float(held @ np.log(self._noise.scale * left))
        return self._log_of(self._filter[1].spread)

    def apply(self, columns: Array) -> Array:
        """Columns (..., 3, A) of whitened components, made white; each stays in its place."""
        if self._plain and self._roots is None:
            return columns / self._noise.scale if self._noise.scale != 1.0 else columns
        flat = columns.reshape(-1, *columns.shape[-2:])
        out = np.empty_like(flat)
        for first in range(0, flat.shape[0], ABREAST):
            part = slice(first, first + ABREAST)
            rows = np.ascontiguousarray(flat[part].transpose(2, 1, 0))
            out[part] = self.by_reading(rows).transpose(2, 1, 0)
        return out.reshape(columns.shape)

    def by_reading(self, rows: Array) -> Array:
        """The same of columns that lie reading by reading, (A, 3, k)."""
        if not (self._plain or self._chained):
            return innovations(*self._filter, rows)
        if self._roots is not None:
            rows = _times(self._roots[1], rows)
        if self._plain:
            return rows / self._noise.scale if self._noise.scale != 1.0 else rows
        order, rho = self._taking.order, self._rho
        left = 1.0 / (self._noise.scale * np.sqrt(1.0 - rho**2))
        out = np.empty_like(rows)
        for first in range(0, order.size, TOGETHER):
            part = slice(first, first + TOGETHER)
            before = rows[order[np.arange(first - 1, order[part].size + first - 1)]]
            before *= (-left * rho)[part, None, None]
            before += left[part, None, None] * rows[order[part]]
            out[order[part]] = before
        return out

    def products(self, rows: Array) -> tuple[Array, float]:
        """Columns (A, 3, k), made white, times one another, (k, k), and log det C."""
        if self._plain or self._chained or not in_one_pass():
            flat = self.by_reading(rows).reshape(-1, rows.shape[2])
            return flat.T @ flat, self.log_det
        own = None if self._roots is None else self._roots[1]
        found, spread = products(self._layout, self._sizes, own, rows)
        return found, self._log_of(spread)

    @cached_property
    def _log_own(self) -> float:
        """log det of the readings' own scatter."""
        if self._roots is None:
            return 0.0
        return 2.0 * float(np.sum(np.log(np.diagonal(self._roots[0], axis1=1, axis2=2))))

    def _log_of(self, spread: Array) -> float:
        """log det C, of a filter's spread (T, B, 3)."""
        layout, live = self._layout, self._taking.live
        logs = np.log(spread[layout.there])
        if live is not None:
            logs = logs * live[:, layout.reading[layout.there]].T
        return self._log_own + 2.0 * float(np.sum(logs))

    @cached_property
    def _rho(self) -> Array:
        """What goes on from the reading before (A,), in the order of time."""
        return np.asarray(np.exp(-self._taking.gaps(self._noise.by_row) / self._noise.tau_s))

    @property
    def _layout(self) -> Layout:
        return _laid_out(self._taking, self._noise.tau_s > 0.0, self._noise.visit > 0.0)

    @property
    def _sizes(self) -> Sizes:
        noise, rho = self._noise, None
        if noise.tau_s > 0.0:
            rho = np.empty(self._taking.run.size)
            rho[self._taking.order] = self._rho
        share = 0.0 if rho is None else noise.share
        return Sizes(rho, noise.scale**2, share, noise.visit**2)

    @cached_property
    def _filter(self) -> tuple[Layout, Filters]:
        """The filter of all readings, those that are whitened by a root's inverse W first as well.

        With y' = W y the innovation S^-1/2 (y' - H' x) is S^-1/2 W (y - W^-1 H' x): readings are
        taken as they are, and only what the filter knows of each is changed.
        """
        layout, sizes = self._layout, self._sizes
        if self._roots is None:
            return layout, filters(layout, sizes)
        first = 0 if sizes.rho is None else 3
        root, own = (one[layout.reading] for one in self._roots)
        seen, raw = layout.seen.copy(), layout.seen
        seen[..., first:] = _times(own, layout.seen[..., first:])
        found = filters(replace(layout, seen=seen), sizes)
        if first:
            raw = raw.copy()
            raw[..., :first] = root * layout.there[..., None, None]
        gain, white = _by(found.gain, own), _by(found.white, own)
        return replace(layout, seen=raw), replace(found, gain=gain, white=white)


def _times(lower: Array, rows: Array) -> Array:
    """Lower triangular matrices (A, ..., 3, 3) times rows (A, ..., 3, k)."""
    out = np.empty_like(rows)
    for first in range(0, len(rows), TOGETHER):
        part = slice(first, first + TOGETHER)
        for row in range(3):
            own = out[part, ..., row, :]
            np.multiply(lower[part, ..., row, 0, None], rows[part, ..., 0, :], out=own)
            for other in range(1, row + 1):
                own += lower[part, ..., row, other, None] * rows[part, ..., other, :]
    return out


def _by(columns: Array, lower: Array) -> Array:
    """Columns (..., k, 3) times lower triangular matrices (..., 3, 3)."""
    out = np.empty_like(columns)
    for k in range(3):
        np.multiply(columns[..., 2], lower[..., 2, None, k], out=out[..., k])
        for other in range(k, 2):
            out[..., k] += columns[..., other] * lower[..., other, None, k]
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
