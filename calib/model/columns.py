"""An effect's signature as whitened derivatives of the readings."""

from collections.abc import Callable, Sequence

import numpy as np

from calib.arrays import Array, BoolArray
from calib.effects.component import Effect, Signature, Situation
from calib.effects.lever import apply_each, through
from calib.mechanism.rigid import rotate
from calib.runs.stack import Rows
from calib.unknown import Unknown, linear_among


def at_trial(unknowns: Sequence[Unknown], trial: Sequence[float]) -> Array:
    """Values (U,) of an effect that does nothing yet, its nonlinear unknowns at a trial."""
    values = np.zeros(len(unknowns))
    values[~linear_among(unknowns)] = trial
    return values


def channels_known(effect: Effect, rows: Rows) -> BoolArray:
    """Readings (N,) that have all that an effect needs to be told (reference readings always)."""
    known = effect.told(rows)
    for name in (*effect.channels, *effect.depends):
        if name in rows.channels:
            known &= np.isfinite(rows.channels[name])
    return known | ~rows.on_platform if effect.kind == "machine" else known


def whitened_columns(signature: Signature, situation: Situation) -> Array:
    """Whitened derivative (U, 3, N) of the readings by an effect's unknowns."""
    rows = situation.rows
    total: Array | float = 0.0
    if signature.extension is not None:
        total = _contract(
            _known(signature.extension), 3, lambda actuator: situation.actuator_columns[actuator]
        )
    if signature.parameters is not None:
        twists = _contract(
            _known(signature.parameters),
            6,
            lambda parameter: situation.twists_of(np.array([parameter]))[0],
        )
        total = total + through(situation.lever, twists)
    if signature.twist is not None:
        total = total + through(situation.lever, _known(signature.twist))
    if signature.nest is not None:
        turned = np.stack([rotate(situation.rotation, shape) for shape in signature.nest])
        total = total + apply_each(situation.whitened_frame * rows.on_platform, turned)
    if signature.point is not None:
        total = total + apply_each(situation.whitener * rows.optical, _known(signature.point))
    return rows.folded(np.asarray(total))


def _known(shape: Array) -> Array:
    """The same with zero where a channel is missing."""
    return shape if np.isfinite(shape).all() else np.nan_to_num(shape)


def _contract(shape: Array, width: int, twists: Callable[[int], Array]) -> Array:
    """Sum over the middle axis: (U, n, N) and n of (k, N) -> (U, k, N), skipping what is zero."""
    out = np.zeros((shape.shape[0], width, shape.shape[2]))
    for unknown, actuator in zip(*np.nonzero(np.any(shape, axis=2)), strict=True):
        out[unknown] += shape[unknown, actuator] * twists(int(actuator))
    return out


def change_of(signatures: list[tuple[Array, Signature]], what: str, like: Array) -> Array:
    """Sum over effects of amplitudes (U,) times one field of their signatures, like ``like``."""
    total = np.zeros_like(like)
    for linear, signature in signatures:
        shape = getattr(signature, what)
        if shape is not None:
            total += np.nan_to_num(np.tensordot(linear, shape, axes=1))
    return total
