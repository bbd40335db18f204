"""The discovery of one analysis: which effects are in the model, and how the error fell."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from app.analysis import masked_rows
from app.tui.analysis import OwnEffects, load_named
from calib.discover.compare import compare_fit
from calib.discover.compare_report import compare_report
from calib.discover.diagnosis import RunDiagnosis
from calib.discover.discovery import SEED, Refitter, discover_run, stage_of
from calib.discover.report import called_for, diagnosis_report, effect_parameters
from calib.effects import catalogue
from calib.errors import BadInput
from calib.evidence.forward import speaks_against


@dataclass(frozen=True)
class Stair:
    """One step of the staircase: what was done, and the error after it, um; nan if unknown."""

    did: str
    rms_um: float
    floor_um: float
    holdout_um: float
    holdout_floor_um: float
    chi2_per_dof: float
    p_value: float | None = None
    weak: bool = False
    rivals: tuple[str, ...] = ()


@dataclass(frozen=True, eq=False)
class View:
    """What is known of the present model: diagnosis and comparison as their verbs answer them."""

    effects: tuple[str, ...]
    run: RunDiagnosis
    diagnosis: Mapping[str, Any]
    comparison: Mapping[str, Any]
    parameters: list[dict[str, Any]]
    shapes: frozenset[str] = frozenset()
    """Unknowns that are no sizes: periods, time constants, moments."""


@dataclass(eq=False)
class Search:
    """Effects put in and taken out of the model of some runs; the runs are never written to.

    The hold-out is that of the runs as they were loaded; each model is fitted once.
    """

    runs: tuple[str, ...]
    refit: Refitter
    stairs: list[Stair] = field(default_factory=list)
    view: View | None = None

    @staticmethod
    def of(
        runs: tuple[str, ...],
        effects: tuple[str, ...] = (),
        own: OwnEffects = OwnEffects(),  # noqa: B008 - frozen
        masked: Sequence[str] = (),
    ) -> "Search":
        """Load runs and look at the model with these effects; ``own`` ones are candidates too.

        ``masked`` are lines of readings that are left out.
        """
        rows, chosen = load_named(runs, effects, own)
        # What the record itself shows is in the model from the start.
        known = {effect.id: effect for effect in catalogue(rows.machine)}
        known |= own.by_name() | {effect.id: effect for effect in chosen}
        search = Search(
            runs, Refitter(rows, tuple(known.values()), masked=masked_rows(rows, masked))
        )
        names = tuple(effect.id for effect in chosen)
        search._climb("start", names)
        search._look(names)
        return search

    @property
    def present(self) -> View:
        """The present model."""
        assert self.view is not None
        return self.view

    def add(self, name: str) -> None:
        """Put an effect in; raises :class:`BadInput` if held-out poses speak against it."""
        before = self.present.run.holdout.rms_mm
        names = (*self.present.effects, name)
        after = self.refit(names).holdout
        if speaks_against(before, after):
            raise _refused(name, before, after)
        self._climb(f"+ {name}", names, called_for(self.present.run, name))
        self._look(names)

    def remove(self, name: str) -> None:
        """Take an effect out."""
        names = tuple(each for each in self.present.effects if each != name)
        self._climb(f"- {name}", names)
        self._look(names)

    def go_on(self) -> None:
        """Add by itself what is called for, until nothing more is."""
        found = discover_run(self.refit, self.present.effects)
        for number, step in enumerate(found.steps[1:], start=1):
            did = f"+ {step.added}" if step.added else f"- {step.removed}"
            before = stage_of(found, number - 1).run
            called = called_for(before, step.added) if step.added else {}
            self._climb(did, stage_of(found, number).effects, called)
        self._look(found.last.effects)

    def _climb(
        self, did: str, names: tuple[str, ...], called: Mapping[str, Any] | None = None
    ) -> None:
        """Put a step on the staircase; ``called``: how an effect was called for that is new."""
        known = called or {}
        run = self.refit(names).run
        fit, held = run.fit, run.holdout
        self.stairs.append(
            Stair(
                did, 1000.0 * fit.rms_mm, 1000.0 * fit.noise_floor_mm,
                1000.0 * held.rms_mm, 1000.0 * held.floor_mm, fit.chi2_per_dof,
                known.get("p_value"), bool(known.get("weak")), tuple(known.get("rivals", ())),
            )
        )  # fmt: skip

    def _look(self, names: tuple[str, ...]) -> None:
        """Diagnose and compare the model where the staircase has come to."""
        run = self.refit(names).run
        comparison = compare_report(compare_fit(run.fit, np.random.default_rng(SEED)))
        shapes = frozenset(
            unknown.name
            for effect in self.refit.effects.values()
            for unknown in effect.unknowns(self.refit.rows)
            if unknown.nonlinear
        )
        found = effect_parameters(run.fit)
        self.view = View(names, run, diagnosis_report(run), comparison, found, shapes)


def _refused(name: str, before: float, after: float) -> BadInput:
    """Why an effect is not accepted; RMS over held-out poses before and after, mm."""
    if math.isinf(after):
        return BadInput(
            f"{name} is not accepted: the readings do not determine a model with it",
            remedy="Choose another, or measure more",
        )
    return BadInput(
        f"{name} is not accepted: poses that the fit has not seen would be predicted worse "
        f"({_apart(1000 * before, 1000 * after)} um)",
        remedy="It fits noise. Choose another, or measure more",
    )


def _apart(before: float, after: float) -> str:
    """Two numbers with as many digits as tell them apart, two at least and five at most."""
    both = (before, after)
    texts = ([f"{value:.{digits}f}" for value in both] for digits in range(2, 6))
    return " -> ".join(next((one for one in texts if one[0] != one[1]), [f"{v:.5f}" for v in both]))
