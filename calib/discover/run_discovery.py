"""Discovery on a run: add the best effect, refit, and go on until nothing more is called for."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.discover.forward import Discovery, Stage, discover
from calib.discover.run_diagnosis import RunDiagnosis, diagnose_fit, fit_effects
from calib.effects.component import Effect
from calib.errors import BadInput
from calib.identify.fitting import Fit
from calib.runs.stack import Rows

SEED = 20_260_801
"""The null draws are the same every time: the same run gets the same answer."""


@dataclass(frozen=True)
class RunStage(Stage):
    """A stage of the staircase with its fit."""

    run: RunDiagnosis


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
        self._seed = seed
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
        """Fit and diagnose; a model that cannot be fitted predicts nothing and so is refused."""
        if names not in self._stages:
            if self._watch is not None:
                self._watch(names)
            try:
                self.fit(names)
            except BadInput:
                if not self._stages:
                    raise
                first = next(iter(self._stages.values()))
                return replace(first, effects=names, holdout=float("inf"))
            found = diagnose_fit(
                self.fit(names), tuple(self.effects.values()), np.random.default_rng(self._seed)
            )
            self._stages[names] = RunStage(names, found.holdout.rms_mm, found.diagnosis, found)
        return self._stages[names]

    def _effect(self, name: str) -> Effect:
        try:
            return self.effects[name]
        except KeyError:
            raise BadInput(
                f"unknown effect {name!r}", remedy=f"Known: {', '.join(self.effects)}"
            ) from None


def discover_run(refit: Refitter, begin: tuple[str, ...] = ()) -> Discovery:
    """Find the effects that a run calls for, beginning with those that the operator put in."""
    return discover(refit, begin, keep=begin)


def stage_of(discovery: Discovery, step: int = -1) -> RunStage:
    """A step's stage with its fit."""
    stage = discovery.steps[step].stage
    assert isinstance(stage, RunStage)
    return stage
