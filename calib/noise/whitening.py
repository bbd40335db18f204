"""Readings with correlated noise, turned into as many whose noise is white: L^-1 y, C = L L^T.

L^-1 is never formed. Reading by reading a Kalman filter predicts the correlated part from what came
before; what it does not predict, over its standard deviation, is white (the innovations). With the
state x = (z, u), the reading y = H x + w and the state's covariance P,

    S = H P H^T + R,    v = S^-1/2 (y - H x),    K = P H^T S^-1,    x += K (y - H x),  P -= K S K^T

and log det C is the sum of log det S (Harvey 1989, 3.4). The cost is linear in the readings.
Readings that share nothing but their visit are filtered visit by visit, all visits at once.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.noise.component import Noise, Taking

CHUNK = 1024
"""Columns that are filtered at once."""


@dataclass(frozen=True, eq=False)
class _Step:
    """One step of B filters at once: the reading of each, and what is done with it."""

    reading: IntArray
    there: BoolArray
    fade: Array
    seen: Array
    white: Array
    gain: Array


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
        self._plain = noise.tau_s <= 0.0 and noise.visit <= 0.0
        self._steps: list[_Step] = []
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
            self.log_det = self._prepare(taking)

    def apply(self, columns: Array) -> Array:
        """Columns (..., 3, A) of whitened components, made white; each stays in its place."""
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
        parts = [self._filtered(flat[k : k + CHUNK]) for k in range(0, flat.shape[0], CHUNK)]
        return np.concatenate(parts).reshape(columns.shape) if parts else columns

    def _filtered(self, flat: Array) -> Array:
        """Innovations of columns (k, 3, A)."""
        readings = np.ascontiguousarray(np.moveaxis(flat, 0, -1).swapaxes(0, 1))
        out = np.zeros_like(readings)
        batch, size = self._steps[0].gain.shape[:2]
        state = np.zeros((batch, size, flat.shape[0]))
        for step in self._steps:
            state *= step.fade
            off = readings[step.reading] - step.seen @ state
            state += step.gain @ off
            out[step.reading[step.there]] = (step.white @ off)[step.there]
        return np.asarray(np.moveaxis(out.swapaxes(0, 1), -1, 0))

    def _prepare(self, taking: Taking) -> float:
        """Run the covariances through all filters; log det of the whole covariance."""
        noise, order = self._noise, taking.order
        ties = noise.tau_s > 0.0
        first = 3 if ties else 0
        size = first + (taking.motions.shape[0] if noise.visit > 0.0 else 0)
        sequences = _sequences(taking, order, ties)
        rho = np.zeros(self._count)
        rho[order] = np.exp(-taking.gaps(noise.by_row) / noise.tau_s) if ties else 0.0
        variance, correlated = noise.scale**2, noise.share if ties else 0.0
        covariance = np.zeros((len(sequences), size, size))
        before = np.full(len(sequences), -2)
        log_det = 0.0
        for place in range(max(len(one) for one in sequences)):
            there = np.array([place < len(one) for one in sequences])
            reading = np.array([one[min(place, len(one) - 1)] for one in sequences], dtype=np.intp)
            fade = np.ones((len(sequences), size))
            fade[:, :first] = rho[reading][:, None]
            visit = taking.visit[reading]
            new = (visit != before) & (visit >= 0)
            fade[:, first:][new] = 0.0
            before = np.where(visit >= 0, visit, before)
            covariance = covariance * fade[:, :, None] * fade[:, None, :]
            fresh = np.zeros((len(sequences), size))
            fresh[:, :first] = (correlated * variance * (1.0 - rho[reading] ** 2))[:, None]
            fresh[:, first:][new] = noise.visit**2
            covariance[:, np.arange(size), np.arange(size)] += fresh
            step, spread, covariance = _update(
                taking, reading, there, fade, covariance, (1.0 - correlated) * variance, first
            )
            self._steps.append(step)
            logs = np.log(spread[there])
            if taking.live is not None:
                logs = logs * taking.live[:, reading[there]].T
            log_det += 2.0 * float(np.sum(logs))
        return log_det


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


def _update(
    taking: Taking,
    reading: IntArray,
    there: BoolArray,
    fade: Array,
    covariance: Array,
    white: float,
    first: int,
) -> tuple[_Step, Array, Array]:
    """One reading of every filter: the step, the diagonal of S^1/2 (B, 3), P after it."""
    count, size = fade.shape
    seen = np.zeros((count, 3, size))
    seen[:, :, :first] = np.eye(3)[:, :first]
    if size > first:
        held = taking.visit[reading] >= 0
        seen[:, :, first:] = np.moveaxis(taking.motions[:, :, reading], -1, 0).swapaxes(1, 2)
        seen[:, :, first:] *= held[:, None, None]
    seen = seen * there[:, None, None]
    reach = covariance @ seen.swapaxes(1, 2)
    total = seen @ reach
    total[:, np.arange(3), np.arange(3)] += np.where(there, white, 1.0)[:, None]
    factor = np.linalg.cholesky(total)
    inverse = np.linalg.inv(factor)
    gain = reach @ (inverse.swapaxes(1, 2) @ inverse)
    after = covariance - gain @ reach.swapaxes(1, 2)
    step = _Step(reading, there, fade[:, :, None], seen, inverse, gain)
    return step, np.diagonal(factor, axis1=1, axis2=2), after
