"""How a verb answers: data on standard output, talk on standard error."""

import json
import os
import re
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import click

from app.plain_data import plain, printable
from app.written import writable

_LATE_CONTROLS = re.compile(r"[\x7f-\x9f\u202a-\u202e\u2066-\u2069]")
_Function = TypeVar("_Function", bound=Callable[..., Any])


class WrittenFile(click.Path):
    """An option that names a file to be written: checked before the verb does anything."""

    def __init__(self) -> None:
        super().__init__(path_type=Path)

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Path:
        """Take the path if a file can be written there; raises BadInput."""
        return writable(Path(os.fsdecode(super().convert(value, param, ctx))))


def json_option(function: _Function) -> _Function:
    """Give a verb ``--json``; it arrives as the argument ``as_json``."""
    return click.option(
        "--json", "as_json", is_flag=True, help="Answer with one JSON object on standard output."
    )(function)


def show(data: Mapping[str, Any], as_json: bool, text: str) -> None:
    """Print ``data`` as one JSON object, or ``text`` for a person."""
    if as_json:
        print_json(data)
    else:
        click.echo(printable(text))


def print_json(data: Mapping[str, Any]) -> None:
    """Print one JSON object; numbers that are not finite become null, as JSON has no others."""
    # JSON writes out the other controls by itself.
    click.echo(_LATE_CONTROLS.sub(_written_out, json.dumps(plain(data), ensure_ascii=False)))


def say(text: str) -> None:
    """Tell the operator something that is not the answer."""
    click.echo(printable(text), err=True)


def _written_out(found: re.Match[str]) -> str:
    return f"\\u{ord(found[0]):04x}"


@contextmanager
def working(text: str) -> Iterator[None]:
    """Show that something takes its time, and for how long, while a person looks on."""
    if not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.progress import BarColumn, Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    console = Console(stderr=True)
    columns = (SpinnerColumn(), TextColumn(text, markup=False), BarColumn(24), TimeElapsedColumn())
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as progress:
        progress.add_task("", total=None)
        yield


def interactive() -> bool:
    """Whether a person is there to answer a question."""
    return sys.stdin.isatty() and sys.stderr.isatty()
