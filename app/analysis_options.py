"""What the verbs that analyse a machine have in common: which machine, which closure."""

from collections.abc import Callable
from typing import Any, TypeVar

import click

from app.files.machines import load_machine
from calib.mechanism.description import Machine
from calib.mechanism.variants import with_closure

_Function = TypeVar("_Function", bound=Callable[..., Any])


def machine_options(function: _Function) -> _Function:
    """MACHINE and ``--closure``; they arrive as ``machine_name`` and ``closure``."""
    function = click.option(
        "--closure", default="", help="Another closure of an over-constrained machine's file."
    )(function)
    return click.argument("machine_name", metavar="MACHINE")(function)


def chosen_machine(machine_name: str, closure: str) -> Machine:
    """The machine that was named, closed as asked for."""
    machine = load_machine(machine_name)
    return with_closure(machine, closure) if closure else machine


def bars(values: list[float], width: int = 24) -> list[str]:
    """Bars of text, as long as their values."""
    largest = max(values, default=0.0)
    return ["#" * round(width * value / largest) if largest > 0.0 else "" for value in values]
