"""Options that analysing verbs share: which machine, which effects in the model, who watches."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol, TypeVar

import click

from app import answer

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


def offer_options(function: _Function) -> _Function:
    """Give a verb ``--offer FILE`` (repeatable) and ``--site FILE``; see :func:`offers`."""
    function = click.option(
        "--site",
        type=click.Path(path_type=Path),
        help="Offer the effects that this site file names in [effects].",
    )(function)
    return click.option(
        "--offer",
        multiple=True,
        type=click.Path(path_type=Path),
        metavar="FILE",
        help="An effect file that is a candidate beside the catalogue (repeatable).",
    )(function)


def offers(offer: tuple[Path, ...], site: Path | None) -> tuple[Path, ...]:
    """Effect files that are candidates: those of ``--offer``, and those that the site names."""
    if site is None:
        return offer
    from app.files.site import load_site  # its devices' kinds: only where a site is named

    return (*load_site(site).offers, *offer)


def each_run_option(function: _Function) -> _Function:
    """Give a verb ``--each-run``."""
    return click.option(
        "--each-run",
        is_flag=True,
        help="Of several runs: ask as well whether one run alone has an effect (backlash@2).",
    )(function)


def residuals_option(function: _Function) -> _Function:
    """Give a verb ``--residuals FILE``."""
    return click.option(
        "--residuals",
        type=answer.WrittenFile(),
        metavar="FILE",
        help="Write measured minus predicted of every reading, as CSV.",
    )(function)


class Residuals(Protocol):
    """An answer that can write the residuals behind it."""

    def residuals(self, file: Path) -> None:
        """Write them."""


def written_residuals(found: Residuals, path: Path | None) -> None:
    """Write residuals where that was asked for, and say so."""
    if path is not None:
        found.residuals(path)
        answer.say(f"residuals written to {path}")


def mask_option(function: _Function) -> _Function:
    """Give a verb ``--mask LINE`` (repeatable)."""
    return click.option(
        "--mask",
        multiple=True,
        metavar="LINE",
        help="Leave the reading in this line of points.csv out; every answer says so. Of several "
        "runs RUN:LINE (repeatable).",
    )(function)


def watcher() -> Callable[[tuple[str, ...]], None] | None:
    """Tells every model that is looked at on standard error, on a terminal."""
    return _tell if answer.interactive() else None


def _tell(names: tuple[str, ...]) -> None:
    answer.say(f"looking at baseline{''.join(' + ' + name for name in names)} ...")


def machine_options(function: _Function) -> _Function:
    """MACHINE and ``--closure``; they arrive as ``machine_name`` and ``closure``."""
    function = click.option(
        "--closure", default="", help="Another closure of an over-constrained machine's file."
    )(function)
    return click.argument("machine_name", metavar="MACHINE")(function)


def spread_options(function: _Function) -> _Function:
    """Give a verb ``--workers N`` and ``--scheduler ADDRESS``: who does it (:mod:`app.spread`)."""
    function = click.option(
        "--scheduler",
        default="",
        metavar="ADDRESS",
        help="Let the workers of a Dask scheduler do it, tcp://HOST:PORT.",
    )(function)
    return click.option(
        "--workers", type=click.IntRange(1), help="Processes.  [default: one for each processor]"
    )(function)


def monte_carlo_option(function: _Function) -> _Function:
    """Give a verb ``--monte-carlo MACHINES``."""
    return click.option(
        "--monte-carlo",
        type=click.IntRange(0),
        default=0,
        metavar="MACHINES",
        help="Draw so many machines within their tolerances, too, and close each exactly.",
    )(function)


@contextmanager
def progress() -> Iterator[Callable[[int, int], None] | None]:
    """A bar on standard error while a person looks on: told how many of how many are done."""
    if not answer.interactive():
        yield None
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TimeRemainingColumn

    columns = (MofNCompleteColumn(), BarColumn(24), TimeRemainingColumn())
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task("", total=None)
        yield lambda done, of: bar.update(task, completed=done, total=of)


def bars(values: list[float], width: int = 24) -> list[str]:
    """Bars of text, as long as their values."""
    largest = max(values, default=0.0)
    return ["#" * round(width * value / largest) if largest > 0.0 else "" for value in values]
