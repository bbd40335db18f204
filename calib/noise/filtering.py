"""The steps of the Kalman filter, in C where it was built, else with numpy; laws compare the two.

With the state x, its covariance P, and a reading y = H x + w of three components,

    x, P fade;   S = H P H^T + R;   v = S^-1/2 (y - H x);   K = P H^T S^-1;   x += K (y - H x)

Of a step only the covariance (for the gains) and the state (for the readings) are carried on one by
one. As the kinematics do, the filter goes without C where ``PKMCAL_COMPILED=off`` is in the
environment.
"""

from dataclasses import dataclass, field

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.mechanism import kernel

try:
    from calib.noise import _filter
except ImportError:
    _version = 0
else:
    _version = _filter.VERSION

ROOM = 250_000
"""Numbers that the states of steps may hold: as many steps are taken at once as there is room for,
so that the time is linear in the readings."""


@dataclass(frozen=True, eq=False)
class Layout:
    """B sequences of readings, T steps long, with an n-fold state (n may be 3: no visits).

    ``reading`` (T, B), ``there`` (T, B): which, and whether there is one; ``new`` (T, B): whether a
    visit begins; ``seen`` (T, B, 3, n): H, nought where there is no reading.
    """

    reading: IntArray
    there: BoolArray
    new: BoolArray
    seen: Array
    ended: IntArray = field(init=False)
    """``reading``, -1 where there is none."""
    begun: IntArray = field(init=False)
    """``new`` as numbers."""

    def __post_init__(self) -> None:
        ended = np.where(self.there, self.reading, -1).astype(np.int64)
        object.__setattr__(self, "ended", ended)
        object.__setattr__(self, "begun", self.new.astype(np.int64))


@dataclass(frozen=True, eq=False)
class Filters:
    """Gains and spreads of all steps.

    ``fade`` (T, B, n): of the state, before each step; ``gain`` (T, B, n, 3): K; ``white``
    (T, B, 3, 3): S^-1/2, lower triangular; ``spread`` (T, B, 3): the diagonal of S^1/2.
    """

    fade: Array
    gain: Array
    white: Array
    spread: Array


def compiled() -> bool:
    """Whether the steps are done in C."""
    return _version >= 1 and kernel.wanted()


def in_one_pass() -> bool:
    """Whether :func:`products` is there: in C that was built before it was written it is not."""
    return _version >= 2 and kernel.wanted()


@dataclass(frozen=True, eq=False)
class Sizes:
    """Sizes of a noise as the filter takes them.

    ``rho`` (A,) is what is left of what goes on in time, from the reading before, or None;
    ``variance`` of a reading, ``share`` the part of it that goes on, ``visit`` the variance of a
    visit.
    """

    rho: Array | None
    variance: float
    share: float
    visit: float


def filters(layout: Layout, sizes: Sizes) -> Filters:
    """Run the covariances of a noise through all sequences."""
    fade = np.ones((*layout.there.shape, layout.seen.shape[3]))
    fresh = np.zeros_like(fade)
    first = 0 if sizes.rho is None else 3
    if sizes.rho is not None:
        fade[..., :first] = sizes.rho[layout.reading][..., None]
        fresh[..., :first] = sizes.share * sizes.variance * (1.0 - fade[..., :first] ** 2)
    fade[..., first:][layout.new] = 0.0
    fresh[..., first:][layout.new] = sizes.visit
    noise = np.where(layout.there, (1.0 - sizes.share) * sizes.variance, 1.0)
    steps, batch, _, size = layout.seen.shape
    gain = np.empty((steps, batch, size, 3))
    if compiled():
        white, spread = np.empty((steps, batch, 3, 3)), np.empty((steps, batch, 3))
        fade, noise = np.ascontiguousarray(fade), np.ascontiguousarray(noise)
        _filter.gains(
            steps, batch, size, layout.seen, fade, fresh, noise, gain, white, spread
        )  # fmt: skip
        return Filters(fade, gain, white, spread)
    fades = fade[..., :, None] * fade[..., None, :]
    added = fresh[..., None] * np.eye(size)
    own = noise[..., None, None] * np.eye(3)
    back = np.ascontiguousarray(layout.seen.swapaxes(-1, -2))
    total = np.empty((steps, batch, 3, 3))
    covariance = np.zeros((batch, size, size))
    for step in range(steps):
        covariance *= fades[step]
        covariance += added[step]
        reach = covariance @ back[step]
        total[step] = layout.seen[step] @ reach + own[step]
        gain[step] = reach @ np.linalg.inv(total[step])
        covariance -= gain[step] @ reach.swapaxes(1, 2)
        covariance = 0.5 * (covariance + covariance.swapaxes(1, 2))
    factor = np.linalg.cholesky(total)
    spread = np.diagonal(factor, axis1=-2, axis2=-1)
    return Filters(fade, gain, np.linalg.inv(factor), spread)


def products(layout: Layout, sizes: Sizes, own: Array | None, rows: Array) -> tuple[Array, Array]:
    """What was not predicted of k columns, white, times one another; in one pass, in C alone.

    Parameters
    ----------
    layout : Layout
    sizes : Sizes
    own : (A, 3, 3), optional
        Lower triangular matrices that whiten each reading first.
    rows : (A, 3, k)

    Returns
    -------
    products : (k, k)
    spread : (T, B, 3)
        As of :class:`Filters`.
    """
    steps, batch, _, size = layout.seen.shape
    none = np.empty(0)
    spread, out = np.ones((steps, batch, 3)), np.empty((rows.shape[2], rows.shape[2]))
    _filter.products(
        steps, batch, size, 0 if sizes.rho is None else 3, rows.shape[0], rows.shape[2],
        int(own is not None), sizes.variance, sizes.share, sizes.visit, layout.ended,
        layout.begun, layout.seen, none if sizes.rho is None else sizes.rho,
        none if own is None else own, rows, spread, out,
    )  # fmt: skip
    return out, spread


def innovations(layout: Layout, found: Filters, rows: Array) -> Array:
    """What was not predicted of k columns, white.

    Parameters
    ----------
    layout : Layout
    found : Filters
    rows : (A, 3, k)
    """
    steps, batch, _, size = layout.seen.shape
    out = np.zeros(rows.shape)
    if compiled():
        _filter.innovations(
            steps, batch, size, rows.shape[0], rows.shape[2], layout.ended, layout.seen, found.fade,
            found.gain, found.white, np.ascontiguousarray(rows), out,
        )  # fmt: skip
        return out
    carry = np.eye(size) - found.gain @ layout.seen
    carry[:-1] *= found.fade[1:, :, :, None]
    take = found.gain.copy()
    take[:-1] *= found.fade[1:, :, :, None]
    at_once = max(1, ROOM // (batch * size * rows.shape[2]))
    state = np.zeros((batch, size, rows.shape[2]))
    for first in range(0, steps, at_once):
        part = slice(first, first + at_once)
        there, readings = layout.there[part], rows[layout.reading[part]]
        states = take[part] @ readings
        for step, carried in enumerate(carry[part]):
            after = carried @ state
            after += states[step]
            states[step], state = state, after
        white = found.white[part] @ (readings - layout.seen[part] @ states)
        out[layout.reading[part][there]] = white[there]
    return out
