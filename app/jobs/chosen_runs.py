"""What a caller says: which runs, which files, how many."""

import os
from collections.abc import Sequence
from pathlib import Path

from app.analysis import read_rows
from calib.errors import BadInput
from calib.runs.stack import Rows

Runs = str | os.PathLike[str] | Sequence[str | os.PathLike[str]]
"""One run's folder, or several."""
File = str | os.PathLike[str]


def names_of(runs: Runs) -> tuple[str, ...]:
    """The folders' names, in order."""
    named = [runs] if isinstance(runs, str | os.PathLike) else runs
    return tuple(os.fspath(run) for run in named)


def path_of(file: File | None) -> Path | None:
    """A path, if one is given."""
    return None if file is None else Path(file)


def paths_of(files: Sequence[File]) -> tuple[Path, ...]:
    """Paths of several files."""
    return tuple(Path(file) for file in files)


def lines_of(mask: Sequence[int | str]) -> tuple[str, ...]:
    """Lines of readings that are masked, as text."""
    return tuple(str(line) for line in mask)


def at_least(least: int, **given: int) -> None:
    """Refuse numbers that are too small; raises BadInput naming the argument."""
    for name, value in given.items():
        if value < least:
            raise BadInput(f"{name} is {value}", remedy=f"Give at least {least}")


def load_runs(runs: Runs) -> Rows:
    """Read runs of one machine into arrays.

    Parameters
    ----------
    runs : path or sequence of paths
        Folders with ``run.toml`` and ``points.csv``.

    Returns
    -------
    Rows
        N readings of all runs: ``position`` (3, N) in mm, tracker frame, as the tracker read it;
        ``covariance`` (3, 3, N) in mm2; ``q`` (n, N) commanded actuator coordinates in mm or rad;
        ``nest`` (3, N) in mm, in the platform frame where ``on_platform`` and else in the base
        frame; ``time_s``, ``pose_name``, ``nest_name``, ``channels`` by name, and ``machine``.

    Raises
    ------
    BadInput
        Naming file, line and column of what cannot be read, or runs of two machines.

    Examples
    --------
    >>> rows = pkmcal.load_runs("run")                                       # doctest: +SKIP
    >>> rows.position.shape, rows.machine.name                               # doctest: +SKIP
    ((3, 200), 'hexapod')
    """
    return read_rows(names_of(runs))
