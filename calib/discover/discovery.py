"""Discovery on a run: add the best effect, refit, and go on until nothing more is called for."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import numpy as np

from calib.discover.agreement import runs_at_odds
from calib.discover.diagnosis import RunDiagnosis
from calib.discover.impossible import forbidden_value
from calib.discover.noise import judge
from calib.effects.component import Effect
from calib.errors import BadInput
from calib.evidence.findings import Diagnosis
from calib.evidence.forward import Discovery, Revision, Stage, discover
from calib.evidence.tails import log_tail
from calib.identify.fitting import Fit
from calib.identify.holdout import hold_out
from calib.identify.staged import fit_effects
from calib.runs.stack import Rows
from calib.unknown import linear_among

SEED = 20_260_801
"""The null draws are the same every time: the same run gets the same answer."""


ASTRAY = 1e-3
"""Relative rise of a fit's cost, by one effect more, that is no rounding."""

FAR_APART = 10.0
"""RMS of several runs together, over that apart, that is another machine before it is an effect."""

BEYOND_DOUBT = -14.0
"""log p from which an effect's own estimate says that it is there, whatever else is in."""


@dataclass(frozen=True, eq=False)
class RunStage:
    """A stage of the staircase with its fit; it is diagnosed when first asked."""

    effects: tuple[str, ...]
    holdout: float
    fit: Fit
    examine: Callable[[Fit], RunDiagnosis]

    @cached_property
    def run(self) -> RunDiagnosis:
        """The diagnosis with its fit and the signatures of the candidates."""
        return self.examine(self.fit)

    @property
    def diagnosis(self) -> Diagnosis:
        """What is missing from the model."""
        return self.run.diagnosis

    def release(self) -> None:
        """Hold no columns nor null draws of what was asked: another stage needs the room."""
        if "run" in self.__dict__:
            self.run.diagnosis.release()

    @property
    def doubtful(self) -> frozenset[str]:
        """Effects whose estimates are not far from nothing for their uncertainty (Wald's test).

        One beside which alone another has been asked is in no doubt while that is there.
        """
        fit = self.run.fit
        model = fit.model
        needed = {
            name
            for other in model.effects
            for name in set(other.beside) & set(self.effects)
            if len(set(other.beside) & set(self.effects)) == 1
        }
        first, found = model.free.size, []
        for effect, group in zip(model.effects, model.unknowns, strict=True):
            which = first + np.flatnonzero(linear_among(group))
            first += len(group)
            sigma = fit.sigmas[which]
            distance = (fit.values[which] - model.centre[which]) / sigma
            alike = fit.covariance[np.ix_(which, which)] / sigma / sigma[:, None]
            chi2 = np.array([distance @ np.linalg.solve(alike, distance)])
            chi2 /= max(1.0, fit.chi2_per_dof)
            if log_tail(chi2, which.size)[0] > BEYOND_DOUBT and effect.id not in needed:
                found.append(effect.id)
        return frozenset(found)


class Refitter:
    """Fits and diagnoses models of one run by the names of their effects; each once."""

    def __init__(
        self,
        rows: Rows,
        catalogue: Sequence[Effect],
        *,
        masked: Sequence[int] = (),
        seed: int = SEED,
        watch: Callable[[tuple[str, ...]], None] | None = None,
    ) -> None:
        self.rows = rows
        self.effects = {effect.id: effect for effect in catalogue}
        self._masked = tuple(masked)
        # A stage does not hold the refitter that holds it: its arrays go when nobody asks for it.
        self._examine = partial(judge, catalogue=tuple(self.effects.values()), seed=seed)
        self._watch = watch
        self._fits: dict[tuple[str, ...], Fit] = {}
        self._stages: dict[tuple[str, ...], RunStage] = {}

    def fit(self, names: tuple[str, ...]) -> Fit:
        """Fit the model with the named effects, beginning at a smaller model's optimum."""
        if names not in self._fits:
            begun = self._fits.get(names[:-1]) if names else None
            effects = [self._effect(name) for name in names]
            self._fits[names] = fit_effects(self.rows, effects, self._masked, begun)
        return self._fits[names]

    def __call__(self, names: tuple[str, ...]) -> RunStage:
        """Fit; a model that cannot be fitted predicts nothing and so is refused."""
        if names not in self._stages:
            if self._watch is not None:
                self._watch(names)
            for stage in self._stages.values():
                stage.release()
            try:
                fitted = self.fit(names)
            except BadInput:
                if not self._stages:
                    raise
                first = next(iter(self._stages.values()))
                return replace(first, effects=names, holdout=float("inf"))
            smaller = self._fits.get(names[:-1]) if names else None
            stuck = smaller is not None and worse(fitted, smaller)
            held = float("inf") if stuck else hold_out(fitted).rms_mm
            self._stages[names] = RunStage(names, held, fitted, self._examine)
        return self._stages[names]

    def _effect(self, name: str) -> Effect:
        try:
            return self.effects[name]
        except KeyError:
            raise BadInput(
                f"unknown effect {name!r}", remedy=f"Known: {', '.join(self.effects)}"
            ) from None


def worse(larger: Fit, smaller: Fit) -> bool:
    """Whether a model with more in it explains the same readings worse: its fit went astray.

    What it has more could have stayed at nothing, at the cost of the smaller one.
    """
    same = bool(np.array_equal(larger.accepted, smaller.accepted))
    return same and larger.cost > smaller.cost * (1.0 + ASTRAY) + 0.1


def discover_run(refit: Refitter, begin: tuple[str, ...] = ()) -> Discovery:
    """Find the effects that a run calls for, beginning with those that the operator put in.

    Those that the record itself shows come first.
    """
    shown = tuple(name for name in refit.rows.known if name not in begin)
    stage = refit(begin)
    each_run = any("@" in name for name in refit.effects)  # what changed is then asked
    if not shown and not each_run and of_other_machines(stage):
        return Discovery((Revision(stage),), (), (), ())
    return discover(refit, begin, keep=(*begin, *shown), first=shown, forbids=_forbids)


def of_other_machines(stage: RunStage) -> bool:
    """Whether runs are so far from sharing a geometry that effects would only hide it.

    Each alone is explained, together they are worse by far, with any single effect more, too.
    """
    odds = runs_at_odds(stage.fit)
    if odds is None or odds.together_mm < FAR_APART * odds.apart_mm:
        return False
    best = stage.diagnosis.best
    return best is None or stage.run.outlook(best).rms_mm > FAR_APART * odds.apart_mm


def _forbids(stage: Stage, name: str) -> bool:
    assert isinstance(stage, RunStage)
    return bool(forbidden_value(stage.run, name))


def stage_of(discovery: Discovery, step: int = -1) -> RunStage:
    """A step's stage with its fit."""
    stage = discovery.steps[step].stage
    assert isinstance(stage, RunStage)
    return stage
