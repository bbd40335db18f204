"""What the analysis verbs share: runs from the disk, effects by name, readings stacked."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from app import answer
from app.files.models import chosen_effects
from app.files.runs import read_runs
from calib.discover.discovery import Refitter
from calib.effects import Effect, catalogue
from calib.runs.stack import Rows, stack

_Function = TypeVar("_Function", bound=Callable[..., Any])


def model_options(function: _Function) -> _Function:
    """Give a verb ``--add EFFECT`` (repeatable) and ``--model FILE``."""
    function = click.option(
        "--model",
        type=click.Path(path_type=Path),
        help="Begin with the effects of a saved model file.",
    )(function)
    return click.option(
        "--add", multiple=True, metavar="EFFECT", help="Put an effect in the model (repeatable)."
    )(function)


def load_rows(
    runs: tuple[str, ...], add: tuple[str, ...] = (), model: Path | None = None
) -> tuple[Rows, list[Effect]]:
    """Read runs and find the effects that are asked for; raises BadInput with the place."""
    loaded = read_runs(runs)
    machine = loaded[0].machine
    effects = chosen_effects(machine, add, model)
    return stack(machine, [one.run for one in loaded]), effects


def load_refitter(
    runs: tuple[str, ...], add: tuple[str, ...] = (), model: Path | None = None
) -> tuple[Refitter, tuple[str, ...]]:
    """Make runs ready for diagnosis: a refitter over the catalogue, and the effects to begin with.

    On a terminal, every model that is looked at is told on standard error.
    """
    rows, effects = load_rows(runs, add, model)
    known = {effect.id: effect for effect in (*catalogue(rows.machine), *effects)}
    watch = _tell if answer.interactive() else None
    refit = Refitter(rows, tuple(known.values()), watch=watch)
    return refit, tuple(effect.id for effect in effects)


def _tell(names: tuple[str, ...]) -> None:
    answer.say(f"looking at baseline{''.join(' + ' + name for name in names)} ...")
