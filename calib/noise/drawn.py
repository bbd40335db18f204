"""Noise drawn anew, as readings with some components would have it."""

import numpy as np

from calib.arrays import Array
from calib.noise.component import Noise, Taking


def drawn(taking: Taking, noise: Noise, count: int, rng: np.random.Generator) -> Array:
    """Draws (count, 3, A) of the noise of A readings, in stated sigmas.

    What wanders begins each run at nothing: where it began is the run's frame.
    """
    readings = taking.run.size
    out = rng.standard_normal((count, 3, readings))
    if noise.tau_s > 0.0:
        out *= np.sqrt(1.0 - noise.share)
        out += np.sqrt(noise.share) * _tied(taking, noise, count, rng)
    out *= noise.scale
    if noise.scatter:
        root, _ = taking.scatter.roots(noise.scatter, taking.live)
        out = np.einsum("nij,kjn->kin", root, out)
    if noise.visit > 0.0:
        number = np.unique(taking.visit, return_inverse=True)[1]
        size = (count, taking.motions.shape[0], int(number.max()) + 1)
        errors = noise.visit * rng.standard_normal(size)[:, :, number]
        out += np.einsum("uin,kun->kin", taking.motions * (taking.visit >= 0), errors)
    return np.asarray(out if taking.live is None else out * taking.live)


def _tied(taking: Taking, noise: Noise, count: int, rng: np.random.Generator) -> Array:
    """A process (count, 3, A) of variance one that fades by exp(-gap / tau)."""
    order = taking.order
    fades = np.exp(-taking.gaps(noise.by_row) / noise.tau_s)
    fresh = rng.standard_normal((order.size, count, 3))
    tied = np.empty((count, 3, order.size))
    now = np.zeros((count, 3))
    for fade, each, reading in zip(fades, fresh, order, strict=True):
        begins = fade == 0.0 and noise.step > 0.0
        now = np.zeros_like(now) if begins else fade * now + np.sqrt(1.0 - fade**2) * each
        tied[:, :, reading] = now
    return tied
