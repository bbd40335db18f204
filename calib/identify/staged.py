"""Fits of models with effects, one after the other: nonlinear unknowns are searched first."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect
from calib.identify.fitting import Fit, fit
from calib.identify.signatures import EffectColumns, columns_at, effect_columns
from calib.model.prediction import Model
from calib.model.state import State
from calib.runs.stack import Rows


def fit_effects(
    rows: Rows, effects: Sequence[Effect], masked: Sequence[int] = (), begun: Fit | None = None
) -> Fit:
    """Fit a model with effects; unknowns that are nonlinear are searched for first.

    Parameters
    ----------
    rows : Rows
    effects : sequence of Effect
    masked : sequence of int
        Readings that the operator has masked.
    begun : Fit, optional
        A fit with the first of these effects, to begin with.
    """
    done = len(begun.model.effects) if begun is not None else 0
    latest = begun
    for count in range(done, len(effects)):
        if effects[count].unavailable(rows):
            continue  # the model refuses it in words
        if effects[count].id in rows.known:
            latest = _fitted(rows, effects[:count], masked, latest)
            latest = _known(latest, effects[: count + 1], masked)
            continue
        if not any(unknown.nonlinear for unknown in effects[count].unknowns(rows)):
            continue
        latest = _fitted(rows, effects[:count], masked, latest)
        (one,) = effect_columns(latest, [effects[count]], asked=True)
        start = _searched(latest, one)
        model = Model(rows, effects[: count + 1])
        latest = fit(model, start=start, masked=masked, gross=latest.gross)
    return _fitted(rows, effects, masked, latest)


def _fitted(
    rows: Rows, effects: Sequence[Effect], masked: Sequence[int], latest: Fit | None
) -> Fit:
    """Fit, beginning at what an earlier fit with fewer effects has found."""
    if latest is not None and len(latest.model.effects) == len(effects):
        return latest
    model = Model(rows, effects)
    if latest is None:
        return fit(model, masked=masked)
    state = latest.linear.state
    rest = model.effects_at_rest
    values = (*state.effects, *rest[len(state.effects) :])
    return fit(model, start=begin_at(state, values), masked=masked, gross=latest.gross)


def _known(latest: Fit, effects: Sequence[Effect], masked: Sequence[int]) -> Fit:
    """Fit one more effect that the record shows, beginning at the values that it shows.

    Readings that stand where no nest can be are looked for anew, without what it moves.
    """
    rows = latest.model.rows
    model = Model(rows, effects)
    values = rows.known[effects[-1].id]
    nearby = begin_at(latest.linear.state, (*latest.linear.state.effects, values))
    moved = model.predict(nearby) - latest.model.predict(latest.linear.state)
    without = fit(Model(replace(rows, position=rows.position - moved), effects[:-1]), masked=masked)
    start = begin_at(without.linear.state, (*without.linear.state.effects, values))
    return fit(model, start=start, masked=masked, gross=without.gross)


def begin_at(state: State, values: tuple[Array, ...]) -> State:
    """Start of a larger model at the geometry and frames of a smaller one's optimum."""
    return State(
        state.parameters, values, state.frame_rotation, state.frame_position, state.configuration,
        state.setup,
    )  # fmt: skip


def _searched(latest: Fit, one: EffectColumns) -> State:
    """Start at the trial that explains most of the residual, with its amplitudes."""
    best, _ = _best_trial(latest, one)
    closer = tuple(one.effect.refined(latest.model.rows, one.trials[best]))
    fine = columns_at(latest, one.effect, closer)
    best, amplitudes = _best_trial(latest, fine)
    state = latest.linear.state
    return begin_at(state, (*state.effects, fine.values(closer[best], amplitudes)))


def _best_trial(latest: Fit, one: EffectColumns) -> tuple[int, Array]:
    """Trial with the largest fall of chi-square, and its amplitudes."""
    problem = latest.problem
    sizes = np.array([u.prior_sigma for u in one.unknowns if not u.nonlinear])
    falls: list[float] = []
    found: list[Array] = []
    for trial in range(len(one.trials)):
        columns = latest.whiten(one.at(trial))
        weight = columns @ problem.project(columns).T + np.diag(1.0 / sizes**2)
        scores = columns @ problem.residual
        found.append(np.asarray(np.linalg.solve(weight, scores)))
        falls.append(float(found[-1] @ scores))
    best = int(np.argmax(falls))
    return best, found[best]
