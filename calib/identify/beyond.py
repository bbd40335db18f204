"""Sizes and ranges are priors: what a fit has found beyond them is said."""

from collections.abc import Iterator

import numpy as np

from calib.arrays import Array
from calib.digits import plus_minus
from calib.effects.component import Effect
from calib.identify.fitting import Fit
from calib.unknown import Unknown

FAR, HUGE = 5.0, 20.0
"""Standard deviations of its prior, and times its usual size, beyond which a size is spoken of."""
SLACK = 0.05
"""Part of its range by which a searched unknown may lie outside and nothing is said."""


def beyond_words(fit: Fit) -> list[str]:
    """A sentence for each unknown of an effect that has left what is usual for it.

    Linear unknowns: their value against their prior, or their usual size where they have none.
    Those that are searched (periods, moments): their value against the range of the search.
    """
    model = fit.model
    at = model.free.size
    said: list[str] = []
    for effect, group in zip(model.effects, model.unknowns, strict=True):
        here = slice(at, at + len(group))
        at += len(group)
        values, sigmas = fit.values[here], fit.sigmas[here]
        said += _large(group, values, sigmas)
        if effect.id not in model.rows.known:  # those that the record shows were not searched
            said += _outside(effect, group, values, sigmas, fit)
    return said


def _large(group: tuple[Unknown, ...], values: Array, sigmas: Array) -> Iterator[str]:
    for unknown, value, sigma in zip(group, values, sigmas, strict=True):
        usual, most = unknown.size, HUGE * unknown.size
        if unknown.sigma is not None:
            usual, most = unknown.sigma, FAR * unknown.sigma
        if not unknown.nonlinear and abs(value) > most:
            yield (
                f"{unknown.name} = {plus_minus(value, sigma, unknown.unit)} is "
                f"{abs(value) / usual:.0f} times the {usual:.2g} {unknown.unit}".rstrip()
                + " that is expected of it: something else may pass for it"
            )


def _outside(
    effect: Effect, group: tuple[Unknown, ...], values: Array, sigmas: Array, fit: Fit
) -> Iterator[str]:
    searched = [k for k, unknown in enumerate(group) if unknown.nonlinear]
    trials = np.array(list(effect.trials(fit.model.rows)), dtype=np.float64)
    if not searched or trials.ndim != 2 or trials.shape[1] != len(searched):
        return
    low, high = trials.min(axis=0), trials.max(axis=0)
    for column, k in enumerate(searched):
        room = SLACK * (high[column] - low[column])
        if low[column] - room <= values[k] <= high[column] + room:
            continue
        unit = group[k].unit
        yield (
            f"{group[k].name} = {plus_minus(values[k], sigmas[k], unit)} is outside of the "
            f"{low[column]:.4g} to {high[column]:.4g} {unit} in which it was looked for: these "
            "readings do not hold it"
        )
