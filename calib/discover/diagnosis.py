"""Diagnosis of a fitted run: which effect is missing, how large, and what adding it would bring."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calib.arrays import Array, BoolArray
from calib.discover.problem import effect_candidates, products_of, quadratics_of, variables_of
from calib.effects.component import Effect
from calib.evidence.diagnosis import diagnose
from calib.evidence.findings import Diagnosis, Finding
from calib.evidence.structure import structure_candidates
from calib.identify.fitting import Fit
from calib.identify.holdout import HoldOut, hold_out, hold_out_of
from calib.identify.signatures import EffectColumns, effect_columns
from calib.model.columns import whitened_columns
from calib.noise import Whitening
from calib.scaled import Scaled, normal_matrix
from calib.unknown import Estimate, estimates_of, linear_among


@dataclass(frozen=True, eq=False)
class Outlook:
    """What the error would be with one more effect, to first order.

    ``estimates`` (U) are of all its unknowns, nonlinear ones included.
    """

    rms_mm: float
    holdout: HoldOut
    estimates: tuple[Estimate, ...]


@dataclass(frozen=True, eq=False)
class RunDiagnosis:
    """A fit, what is missing from it, and the signatures of the candidates.

    ``unavailable`` says why some effects of the catalogue cannot be seen in these readings;
    ``noise_or`` names those that explain as much as the noise of the fit does.
    """

    fit: Fit
    diagnosis: Diagnosis
    effects: tuple[EffectColumns, ...]
    unavailable: dict[str, str]
    noise_or: tuple[str, ...] = ()

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
        sigma = np.array([unknown.prior_sigma for unknown in one.unknowns])
        jacobian = np.concatenate([linear.jacobian, own])
        precision = np.concatenate([fitted.prior_precision, 1.0 / sigma**2])
        pull = np.concatenate(
            [fitted.prior_precision * fitted.model.deviation(linear.state), 0.0 * sigma]
        )
        accepted = fitted.accepted & one.known
        chosen, residual = self._freed(jacobian, accepted), self._freed(linear.whitened, accepted)
        covariance = Scaled.of(normal_matrix(chosen, precision)).inverse()
        step = covariance @ (chosen @ residual - pull)
        spread = np.sqrt(np.diag(covariance))
        left = linear.whitened - np.tensordot(step, jacobian, axes=1)
        natural = rows.in_mm(left[:, accepted], accepted)
        told = rows.in_millimetres[:, accepted].any(axis=0)
        held = hold_out_of(
            fitted, linear.whitened, jacobian, precision, pull, accepted, floor=False
        )
        values = np.where(linear_among(one.unknowns), step[-sigma.size :], values)
        return Outlook(
            rms_mm=float(np.sqrt(np.sum(natural**2) / max(told.sum(), 1))),
            holdout=held,
            estimates=estimates_of(one.unknowns, values, spread[-sigma.size :]),
        )

    def _freed(self, columns: Array, which: BoolArray) -> Array:
        """Columns (..., 3, N) of some readings, freed of the noise that they share, (..., 3 M)."""
        chosen = columns[..., which]
        if self.fit.whitening is not None:
            chosen = Whitening(self.fit.taking_of(which), self.fit.noise).apply(chosen)
        return chosen.reshape(*columns.shape[:-2], -1)


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
    problem = fitted.problem
    columns = effect_columns(fitted, catalogue)
    variables = [*variables_of(fitted), *products_of(fitted)]
    structure = structure_candidates(variables)
    answer = diagnose(
        problem,
        effect_candidates(fitted, problem, columns),
        structure if fitted.whitening is None else [one.changed(fitted.freed) for one in structure],
        quadratics_of(fitted),
        rng=generator,
    )
    reasons = {effect.id: effect.unavailable(rows) for effect in catalogue}
    unavailable = {name: reason for name, reason in reasons.items() if reason}
    return RunDiagnosis(fitted, answer, tuple(columns), unavailable)
