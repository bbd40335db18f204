"""Signatures of effects that are not in a fit's model: what each would do to the readings."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, BoolArray
from calib.effects.component import Effect, Scan, Situation
from calib.identify.fitting import Fit
from calib.model.columns import at_trial, channels_known, whitened_columns
from calib.unknown import Unknown, linear_among


@dataclass(frozen=True, eq=False)
class EffectColumns:
    """Signatures of an effect that is not in the model.

    At each of T trials the k linear unknowns have whitened derivatives of all N readings, made
    when they are asked for; ``known`` (N,) marks readings that have the effect's channels.
    """

    effect: Effect
    unknowns: tuple[Unknown, ...]
    trials: tuple[tuple[float, ...], ...]
    situation: Situation
    known: BoolArray

    @property
    def linear(self) -> BoolArray:
        """Which of the unknowns are linear."""
        return linear_among(self.unknowns)

    def some(self, first: int, last: int) -> Array:
        """Derivatives (t, k, 3, N) at the trials first .. last - 1, counted from 0."""
        scan = self.effect.scan(self.situation, self.trials[first:last])
        if scan is None:
            return np.stack([self.at(trial) for trial in range(first, last)])
        steady = self._steady(scan)
        columns = steady[scan.which] if len(steady) > 1 else steady
        made: Array = columns * scan.factors[:, :, None, :]
        return made if self.known.all() else made * self.known

    def _steady(self, scan: Scan) -> Array:
        """Whitened derivatives (s, k, 3, N) of what the trials of a scan have in common."""
        return np.stack([whitened_columns(one, self.situation) for one in scan.steady])

    def at(self, trial: int) -> Array:
        """Derivatives (k, 3, N) at one of the trials, counted from 0."""
        values = at_trial(self.unknowns, self.trials[trial])
        signature = self.effect.signature(self.situation, values)
        columns = whitened_columns(signature, self.situation)[self.linear]
        return columns if self.known.all() else columns * self.known

    def values(self, trial: tuple[float, ...], amplitudes: Array) -> Array:
        """Values of all unknowns (U,): nonlinear ones at a trial, linear ones as given."""
        values = at_trial(self.unknowns, trial)
        values[self.linear] = amplitudes
        return values


def effect_columns(
    fit: Fit, effects: Sequence[Effect], *, asked: bool = False
) -> list[EffectColumns]:
    """Signatures of every effect that these readings can show and the model does not hold.

    Effects that are asked beside others are left out where none of these is held, unless somebody
    has ``asked`` for them.
    """
    rows = fit.model.rows
    values = fit.linear.state.effects
    held = {effect.id: own for effect, own in zip(fit.model.effects, values, strict=True)}
    # A moment with nothing but excluded readings on one side could not be told from any other.
    tried = rows if fit.accepted.all() else rows.take(fit.accepted)
    return [
        columns_at(fit, effect, tuple(effect.trials_beside(tried, held)))
        for effect in effects
        if effect.id not in held
        and (asked or not effect.beside or not held.keys().isdisjoint(effect.beside))
        and not effect.unavailable(rows)
    ]


def columns_at(fit: Fit, effect: Effect, trials: tuple[tuple[float, ...], ...]) -> EffectColumns:
    """Signatures of one effect at given trial values."""
    rows = fit.model.rows
    known = channels_known(effect, rows)
    return EffectColumns(effect, effect.unknowns(rows), trials, fit.linear.situation, known)
