"""What the Fit screen shows: a fit, and how far the readings were off before it."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from app.analysis import looked_at, masked_rows
from app.files.models import offered_effects, own_effects
from app.files.runs import read_runs
from app.jobs.fitting import said_of_fit
from app.jobs.remembering import remember_fit
from app.noisy import noisy
from app.tui.reading_lines import ReadingLine, lines_of_fit
from calib.arrays import Array
from calib.effects import Effect, effect_named
from calib.identify import Fit
from calib.identify.staged import fit_effects
from calib.identify.starting import begin
from calib.model import Model
from calib.runs.stack import Rows


@dataclass(frozen=True, eq=False)
class FitAnswer:
    """A fit with its report (``pkm-fit/1``).

    ``miss_before`` and ``miss_after`` (N,) are 3D distances in mm of the accepted readings from
    the drawing's machine (only the tracker's place fitted) and from the fitted one; ``readings``
    are all, those left out as well.
    """

    runs: tuple[str, ...]
    effects: tuple[str, ...]
    fit: Fit
    report: dict[str, Any]
    miss_before: Array
    miss_after: Array
    readings: tuple[ReadingLine, ...] = ()

    @property
    def before_um(self) -> float:
        """RMS of the 3D distance for the drawing's machine, in the same readings."""
        return 1000.0 * float(np.sqrt(np.mean(self.miss_before**2)))


@dataclass(frozen=True)
class OwnEffects:
    """Where effects come from that are not of the program: the site's files, and a model file."""

    offers: tuple[Path, ...] = ()
    model: Path | None = None

    def by_name(self) -> dict[str, Effect]:
        """Read them; raises BadInput with file and line."""
        found: dict[str, Effect] = {one.id: one for one in offered_effects(self.offers)}
        return found if self.model is None else found | own_effects(self.model)


def load_named(
    runs: tuple[str, ...], effects: tuple[str, ...], own: OwnEffects
) -> tuple[Rows, list[Effect]]:
    """Read runs, and find the effects of these names, and what the record itself shows."""
    loaded, known = read_runs(runs), own.by_name()
    machine = loaded[0].machine
    chosen = [known.get(name) or effect_named(name, machine) for name in effects]
    return looked_at(loaded, chosen)


def identify(
    runs: tuple[str, ...],
    effects: tuple[str, ...] = (),
    masked: Sequence[str] = (),
    own: OwnEffects = OwnEffects(),
) -> FitAnswer:
    """Read runs and fit them without the masked lines; raises BadInput."""
    rows, chosen = load_named(runs, effects, own)
    found = noisy(fit_effects(rows, chosen, masked_rows(rows, masked)), None)
    remember_fit(found, runs)
    return answer_of(runs, found)


def answer_of(runs: tuple[str, ...], found: Fit) -> FitAnswer:
    """Report a fit, with how far the same readings were off before it."""
    nominal, _ = begin(Model(found.model.rows, ()), found.accepted)
    before = np.linalg.norm(nominal.residual[:, found.accepted], axis=0)
    after = np.linalg.norm(found.linear.residual[:, found.accepted], axis=0)
    effects = tuple(effect.id for effect in found.model.effects)
    said = said_of_fit(found)
    return FitAnswer(runs, effects, found, said, before, after, tuple(lines_of_fit(found)))
