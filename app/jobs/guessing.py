"""A first map for a table that nobody has described yet, with every assumption marked."""

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from app.files.guessed_layout import guessed_table
from app.files.machines import load_machine
from app.jobs.chosen_runs import File, Runs, names_of
from app.jobs.guessed_map import Guess
from app.jobs.record import Report
from calib.errors import BadInput

SHOWN = 3


@dataclass(frozen=True, kw_only=True)
class GuessReport(Report):
    """A first map (``pkm-import-guess/1``).

    ``preview``: names, then the first rows, as the file has them; ``assumed`` what was taken for
    granted, each marked in the map; ``missing`` what a person must add before it can be used.
    """

    FORMAT: ClassVar[str] = "pkm-import-guess/1"
    map: str
    columns: int
    rows: int
    preview: tuple[tuple[str, ...], ...]
    assumed: tuple[str, ...]
    missing: tuple[str, ...]


def guess_map(files: Runs, out: File, *, machine: str | None = None) -> GuessReport:
    """Write a first map for tables: what their columns most likely are, and what is not known.

    Parameters
    ----------
    files : path or sequence of paths
        Tables of one layout; the first is looked at.
    out : path
        The map to write, which is not there yet.
    machine : str, optional
        A machine file or a shipped machine: how many actuators there are, and in which units.

    Returns
    -------
    GuessReport

    Raises
    ------
    BadInput
        If the file holds no table, or the map is there already.

    Examples
    --------
    >>> pkmcal.guess_map("points.csv", "map.toml", machine="hexapod").missing  # doctest: +SKIP
    ('[nests.platform] and [nests.base]: where each nest is, mm',)
    """
    names, place = names_of(files), Path(out)
    if place.exists():
        raise BadInput("there is such a file already", place=str(place), remedy="Name another")
    if place.suffix != ".toml":
        raise BadInput(
            "a map is a file that ends in .toml", place="--out", remedy='Write --out "map.toml"'
        )
    table, _ = guessed_table(Path(names[0]))
    guess = Guess(table, None if machine is None else load_machine(machine), machine)
    text = guess.text()
    place.write_text(text, encoding="utf-8", newline="\n")
    shown = [tuple(_clean(cell) for cell in row) for row in table.rows[:SHOWN]]
    names_shown = tuple(table.column_name(at) for at in range(table.width))
    return GuessReport.of(
        {
            "format": GuessReport.FORMAT,
            "map": str(place),
            "columns": table.width,
            "rows": len(table.rows),
            "preview": [names_shown, *shown],
            "assumed": guess.assumed,
            "missing": guess.missing,
        }
    )


def _clean(cell: str) -> str:
    return " ".join(cell.split())
