"""Reading and writing runs on disk."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from app.files.machines import load_machine
from app.files.text import read_text
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.runs import Digits, Run, format_run, parse_header, parse_run
from calib.runs.writing import EXACT
from calib.toml_place import line_of

HEADER = "run.toml"
POINTS = "points.csv"


@dataclass(frozen=True)
class LoadedRun:
    """A run with the machine on which it was taken and the folder from which it came."""

    folder: Path
    run: Run
    machine: Machine


def read_run(folder: str | Path) -> LoadedRun:
    """Read a run's folder (or the path of its ``run.toml``); nothing in it is written to.

    Raises
    ------
    BadInput
        Naming file, line, column, what was found and what was expected.
    """
    folder = Path(folder)
    if folder.name == HEADER and folder.is_file():
        folder = folder.parent
    if not folder.is_dir():
        raise BadInput(
            "no such folder", place=str(folder), remedy=f"A run is a folder with {HEADER}, {POINTS}"
        )
    run_source, points_source = str(folder / HEADER), str(folder / POINTS)
    run_text = read_text(folder / HEADER)
    name = parse_header(run_text, source=run_source).machine
    try:
        machine = load_machine(name, folder)
    except BadInput as error:
        if error.place:
            raise
        place = f"{run_source}, line {line_of(run_text, 'machine')}, machine"
        raise BadInput(error.what, place=place, remedy=error.remedy) from error
    run = parse_run(
        run_text,
        read_text(folder / POINTS),
        actuators=len(machine.actuators),
        units=[actuator.unit for actuator in machine.actuators],
        parameters=[parameter.name for parameter in machine.parameters],
        run_source=run_source,
        points_source=points_source,
    )
    return LoadedRun(folder, run, machine)


def read_runs(folders: tuple[str, ...]) -> list[LoadedRun]:
    """Read several runs of one machine; raises BadInput where two machines are mixed."""
    loaded = [read_run(folder) for folder in folders]
    for other in loaded[1:]:
        if other.machine.parameters != loaded[0].machine.parameters:
            raise BadInput(
                f"machine {other.run.header.machine!r}, but {loaded[0].folder} has "
                f"{loaded[0].run.header.machine!r}",
                place=str(other.folder / HEADER),
                remedy="Fit runs of one machine together",
            )
    for place, other in enumerate(loaded):
        for first in loaded[:place]:
            if np.array_equal(first.run.position, other.run.position, equal_nan=True):
                raise BadInput(
                    f"the readings are those of {first.folder}",
                    place=str(other.folder / POINTS),
                    remedy="Name every run once: readings must not count twice",
                )
    return loaded


def outside_runs(path: Path | None, folders: tuple[str, ...]) -> None:
    """Refuse to write into a run's folder: runs are never written to; raises BadInput."""
    if path is None:
        return
    for folder in folders:
        at = Path(folder).resolve()
        at = at.parent if at.name == HEADER else at
        if path.resolve() == at or at in path.resolve().parents:
            raise BadInput(
                "this lies in a run's folder, and a run is never written to",
                place=str(path),
                remedy="Name a file somewhere else",
            )


def write_run(
    folder: Path,
    run: Run,
    digits: Digits = EXACT,
    *,
    replace: bool = False,
    beside: Mapping[str, Any] | None = None,
) -> None:
    """Write a run's two files, each of them whole or not at all.

    A folder that holds a run already is refused (BadInput), or its run is replaced. ``beside`` are
    more tables of run.toml, which no reader asks for.
    """
    header, points = format_run(run, digits)
    write_texts(folder, header, points, replace=replace, beside=beside)


def write_texts(
    folder: Path,
    header: str,
    points: str,
    *,
    replace: bool = False,
    beside: Mapping[str, Any] | None = None,
) -> None:
    """Write the texts of run.toml and points.csv, see :func:`write_run`."""
    folder.mkdir(parents=True, exist_ok=True)
    texts = {HEADER: header, POINTS: points}
    if beside:
        texts[HEADER] += "\n" + tomli_w.dumps(beside)
    for name in texts:
        if not replace and (folder / name).exists():
            raise BadInput(
                "the file exists already", place=str(folder / name), remedy="Choose another folder"
            )
    for name in (POINTS, HEADER):
        draft = (folder / name).with_suffix(".draft")
        draft.write_text(texts[name], encoding="utf-8", newline="\n")
        draft.replace(folder / name)
