"""What the analysis verbs share: runs from the disk, effects by name, readings stacked."""

from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import click

from app.model_files import chosen_effects
from app.run_files import read_runs
from calib.effects import Effect
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
    effects, _ = chosen_effects(machine, add, model)
    return stack(machine, [one.run for one in loaded]), effects
