"""Signatures of effects that are not in a fit's model: what each would do to the readings."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, BoolArray
from calib.effects.component import Effect
from calib.identify.fitting import Fit
from calib.model.columns import at_trial, channels_known, whitened_columns
from calib.unknown import Unknown, linear_among


@dataclass(frozen=True, eq=False)
class EffectColumns:
    """Signatures of an effect that is not in the model.

    ``columns`` (T, k, 3, N) are whitened derivatives of all readings by the k linear unknowns at
    each of T trials; ``known`` (N,) marks readings that have its channels.
    """

    effect: Effect
    unknowns: tuple[Unknown, ...]
    trials: tuple[tuple[float, ...], ...]
    columns: Array
    known: BoolArray

    def values(self, trial: tuple[float, ...], amplitudes: Array) -> Array:
        """Values of all unknowns (U,): nonlinear ones at a trial, linear ones as given."""
        values = at_trial(self.unknowns, trial)
        values[linear_among(self.unknowns)] = amplitudes
        return values


def effect_columns(fit: Fit, effects: Sequence[Effect]) -> list[EffectColumns]:
    """Signatures of every effect that these readings can show and the model does not hold."""
    rows = fit.model.rows
    held = {effect.id for effect in fit.model.effects}
    # A moment with nothing but excluded readings on one side could not be told from any other.
    tried = rows if fit.accepted.all() else rows.take(fit.accepted)
    return [
        columns_at(fit, effect, tuple(effect.trials(tried)))
        for effect in effects
        if effect.id not in held and not effect.unavailable(rows)
    ]


def columns_at(fit: Fit, effect: Effect, trials: tuple[tuple[float, ...], ...]) -> EffectColumns:
    """Signatures of one effect at given trial values."""
    rows, situation = fit.model.rows, fit.linear.situation
    unknowns = effect.unknowns(rows)
    linear = linear_among(unknowns)
    columns = np.empty((len(trials), sum(linear), 3, rows.count))
    for trial, own in zip(trials, columns, strict=True):
        signature = effect.signature(situation, at_trial(unknowns, trial))
        own[:] = whitened_columns(signature, situation)[linear]
    known = channels_known(effect, rows)
    if not known.all():
        columns *= known
    return EffectColumns(effect, unknowns, trials, columns, known)
