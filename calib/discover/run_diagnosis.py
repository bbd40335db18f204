"""Diagnosis of a fitted run: which effect is missing, how large, and what adding it would bring."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calib.arrays import Array, BoolArray
from calib.discover.diagnosis import diagnose
from calib.discover.findings import Diagnosis, Finding
from calib.discover.run_problem import (
    EffectColumns,
    columns_at,
    effect_candidates,
    effect_columns,
    problem_of,
    quadratics_of,
    variables_of,
)
from calib.discover.structure import structure_candidates
from calib.effects.component import Effect, Unknown
from calib.identify.fitting import Fit, fit
from calib.identify.holdout import HoldOut, hold_out, hold_out_of
from calib.model.columns import whitened_columns
from calib.model.prediction import Model, State
from calib.runs.stack import Rows


@dataclass(frozen=True, eq=False)
class Outlook:
    """What the error would be with one more effect, to first order.

    ``values`` and ``sigmas`` (U,) are of all its unknowns, nonlinear ones included.
    """

    rms_mm: float
    holdout: HoldOut
    unknowns: tuple[Unknown, ...]
    values: Array
    sigmas: Array


@dataclass(frozen=True, eq=False)
class RunDiagnosis:
    """A fit, what is missing from it, and the signatures of the candidates.

    ``unavailable`` says why some effects of the catalogue cannot be seen in these readings.
    """

    fit: Fit
    diagnosis: Diagnosis
    effects: tuple[EffectColumns, ...]
    unavailable: dict[str, str]

    @cached_property
    def holdout(self) -> HoldOut:
        """Hold-out of the fit."""
        return hold_out(self.fit)

    def columns_of(self, name: str) -> EffectColumns:
        """Signatures of a candidate."""
        return next(one for one in self.effects if one.effect.id == name)

    def outlook(self, finding: Finding) -> Outlook:
        """RMS and hold-out RMS with one more effect at its best trial, to first order."""
        one, fitted = self.columns_of(finding.name), self.fit
        rows, linear = fitted.model.rows, fitted.linear
        values = one.values(finding.trial, np.array([e.value for e in finding.estimates]))
        signature = one.effect.signature(linear.situation, values)
        own = whitened_columns(signature, linear.situation) * one.known
        sigma = np.array([unknown.sigma or 1e3 * unknown.size for unknown in one.unknowns])
        larger = _Larger(
            np.concatenate([linear.jacobian, own]),
            np.concatenate([fitted.prior_precision, 1.0 / sigma**2]),
            np.concatenate(
                [fitted.prior_precision * fitted.model.deviation(linear.state), 0.0 * sigma]
            ),
        )
        accepted = fitted.accepted & one.known
        step, spread = larger.solved(linear.whitened, accepted)
        left = linear.whitened - np.tensordot(step, larger.jacobian, axes=1)
        factors = np.linalg.inv(np.moveaxis(rows.whitener, -1, 0))[accepted]
        natural = np.einsum("nij,jn->in", factors, left[:, accepted])
        held = hold_out_of(
            rows, accepted, linear.whitened, larger.jacobian, larger.precision, larger.pull
        )
        nonlinear = np.array([unknown.nonlinear for unknown in one.unknowns])
        count = sigma.size
        return Outlook(
            rms_mm=float(np.sqrt(np.mean(np.sum(natural**2, axis=0)))),
            holdout=held,
            unknowns=one.unknowns,
            values=np.where(nonlinear, values, step[-count:]),
            sigmas=spread[-count:],
        )


@dataclass(frozen=True, eq=False)
class _Larger:
    """The linearised model with the columns of one more effect."""

    jacobian: Array
    precision: Array
    pull: Array

    def solved(self, whitened: Array, accepted: BoolArray) -> tuple[Array, Array]:
        """Step (p,) to the optimum, and standard uncertainties (p,)."""
        chosen = self.jacobian[:, :, accepted].reshape(self.precision.size, -1)
        normal = chosen @ chosen.T + np.diag(self.precision)
        scale = 1.0 / np.sqrt(np.diag(normal))
        covariance = np.linalg.inv(normal * scale[:, None] * scale) * scale[:, None] * scale
        slope = chosen @ whitened[:, accepted].reshape(-1) - self.pull
        return covariance @ slope, np.sqrt(np.diag(covariance))


def diagnose_fit(
    fitted: Fit, catalogue: Sequence[Effect], generator: np.random.Generator
) -> RunDiagnosis:
    """Ask what is missing from a fit.

    Parameters
    ----------
    fitted : Fit
    catalogue : sequence of Effect
        Candidates; those in the model already are left aside.
    generator : numpy Generator
        Draws the null distribution; the same seed gives the same answer.
    """
    rows = fitted.model.rows
    problem = problem_of(fitted)
    columns = effect_columns(fitted, catalogue)
    answer = diagnose(
        problem,
        effect_candidates(fitted, problem, columns),
        structure_candidates(variables_of(fitted)),
        quadratics_of(fitted),
        rng=generator,
    )
    reasons = {effect.id: effect.unavailable(rows) for effect in catalogue}
    unavailable = {name: reason for name, reason in reasons.items() if reason}
    return RunDiagnosis(fitted, answer, tuple(columns), unavailable)


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
        if not any(unknown.nonlinear for unknown in effects[count].unknowns(rows)):
            continue
        latest = _fitted(rows, effects[:count], masked, latest)
        (one,) = effect_columns(latest, [effects[count]])
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


def begin_at(state: State, values: tuple[Array, ...]) -> State:
    """Start of a larger model at the geometry and frames of a smaller one's optimum."""
    return State(
        state.parameters, values, state.frame_rotation, state.frame_position, state.configuration
    )


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
    problem = problem_of(latest)
    columns = one.columns[..., latest.accepted]
    columns = columns.reshape(*one.columns.shape[:2], -1)
    projected = problem.project(columns)
    sizes = np.array([u.sigma or 1e3 * u.size for u in one.unknowns if not u.nonlinear])
    weight = columns @ projected.swapaxes(1, 2) + np.diag(1.0 / sizes**2)
    scores = columns @ problem.residual
    amplitudes = np.linalg.solve(weight, scores[:, :, None])[:, :, 0]
    best = int(np.argmax(np.sum(amplitudes * scores, axis=1)))
    return best, amplitudes[best]
