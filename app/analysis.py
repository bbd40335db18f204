"""Runs from the disk, effects by name, readings stacked: what every analysis begins with."""

from collections.abc import Callable
from pathlib import Path

from app.files.models import chosen_effects
from app.files.runs import read_runs
from calib.discover.discovery import Refitter
from calib.effects import Effect, catalogue
from calib.runs.stack import Rows, stack


def load_rows(
    runs: tuple[str, ...], add: tuple[str, ...] = (), model: Path | None = None
) -> tuple[Rows, list[Effect]]:
    """Read runs and find the effects that are asked for; raises BadInput with the place."""
    loaded = read_runs(runs)
    machine = loaded[0].machine
    effects = chosen_effects(machine, add, model)
    return stack(machine, [one.run for one in loaded]), effects


def load_refitter(
    runs: tuple[str, ...],
    add: tuple[str, ...] = (),
    model: Path | None = None,
    watch: Callable[[tuple[str, ...]], None] | None = None,
) -> tuple[Refitter, tuple[str, ...]]:
    """Make runs ready for diagnosis: a refitter over the catalogue, and the effects to begin with.

    ``watch`` is told the effects of every model that is looked at.
    """
    rows, effects = load_rows(runs, add, model)
    known = {effect.id: effect for effect in (*catalogue(rows.machine), *effects)}
    refit = Refitter(rows, tuple(known.values()), watch=watch)
    return refit, tuple(effect.id for effect in effects)
