"""An effect's signature as whitened derivatives of the readings."""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array, BoolArray
from calib.effects.component import Effect, Signature, Situation, Unknown
from calib.mechanism.rigid import cross, rotate
from calib.runs.stack import Rows


def at_trial(unknowns: Sequence[Unknown], trial: Sequence[float]) -> Array:
    """Values (U,) of an effect that does nothing yet, its nonlinear unknowns at a trial."""
    values = np.zeros(len(unknowns))
    values[[index for index, unknown in enumerate(unknowns) if unknown.nonlinear]] = trial
    return values


def channels_known(effect: Effect, rows: Rows) -> BoolArray:
    """Readings (N,) that have every channel that an effect needs (reference readings always)."""
    known = np.ones(rows.count, dtype=bool)
    for name in (*effect.channels, *effect.depends):
        if name in rows.channels:
            known &= np.isfinite(rows.channels[name])
    return known | ~rows.on_platform if effect.kind == "machine" else known


def whitened_columns(signature: Signature, situation: Situation) -> Array:
    """Whitened derivative (U, 3, N) of the readings by an effect's unknowns."""
    rows = situation.rows
    whitener = rows.whitener
    combined = whitened_frame(whitener, situation.frame_rotation)
    arm = situation.base_point - situation.position
    total: Array | float = 0.0
    lever = lever_of(combined, arm, rows.on_platform)
    if signature.extension is not None:
        shape = np.nan_to_num(signature.extension)
        total = total + _contract(shape, situation.actuator_columns)
    if signature.parameters is not None:
        twists = _contract(np.nan_to_num(signature.parameters), situation.parameter_twists)
        total = total + through(lever, twists)
    if signature.twist is not None:
        total = total + through(lever, np.nan_to_num(signature.twist))
    if signature.nest is not None:
        turned = np.stack([rotate(situation.rotation, shape) for shape in signature.nest])
        total = total + apply_each(combined * rows.on_platform, turned)
    if signature.point is not None:
        total = total + apply_each(whitener, np.nan_to_num(signature.point))
    return np.asarray(total)


def _contract(shape: Array, twists: Array) -> Array:
    """Sum over the middle axis: (U, n, N) and (n, k, N) -> (U, k, N), skipping what is zero."""
    out = np.zeros((shape.shape[0], *twists.shape[1:]))
    for unknown, actuator in zip(*np.nonzero(np.any(shape, axis=2)), strict=True):
        out[unknown] += shape[unknown, actuator] * twists[actuator]
    return out


def change_of(signatures: list[tuple[Array, Signature]], what: str, like: Array) -> Array:
    """Sum over effects of amplitudes (U,) times one field of their signatures, like ``like``."""
    total = np.zeros_like(like)
    for linear, signature in signatures:
        shape = getattr(signature, what)
        if shape is not None:
            total += np.nan_to_num(np.tensordot(linear, shape, axes=1))
    return total


def whitened_frame(whitener: Array, turn: Array) -> Array:
    """Whitener times frame rotation, (3, 3, N)."""
    return np.stack([apply(whitener, turn[:, j]) for j in range(3)], axis=1)


def lever_of(combined: Array, arm: Array, on_platform: BoolArray) -> Array:
    """Matrix (3, 6, N) from the platform's twist to the whitened reading; zero for base nests."""
    lever = np.empty((3, 6, arm.shape[1]))
    lever[:, :3] = combined
    for axis in range(3):
        lever[:, 3 + axis] = apply(combined, cross(np.eye(3)[axis][:, None], arm))
    lever *= on_platform
    return lever


def through(lever: Array, twists: Array) -> Array:
    """(3, 6, N) and (U, 6, N) -> (U, 3, N)."""
    out = np.empty((twists.shape[0], 3, twists.shape[2]))
    for row in range(3):
        out[:, row] = np.einsum("kn,ukn->un", lever[row], twists)
    return out


def apply(matrix: Array, vector: Array) -> Array:
    """(3, 3, N) and (3, N) -> (3, N)."""
    out: Array = np.einsum("ijn,jn->in", matrix, vector)
    return out


def apply_each(matrix: Array, vectors: Array) -> Array:
    """(3, 3, N) and (U, 3, N) -> (U, 3, N)."""
    out: Array = np.einsum("ijn,ujn->uin", matrix, vectors)
    return out
