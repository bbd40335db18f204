"""Bring what instruments and programs export to a run, and look at it at once."""

import hashlib
import os
import tomllib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from app.files.foreign_table import read_foreign
from app.files.import_map import ImportMap, parse_map
from app.files.imported import Imported, imported
from app.files.imported_kinds import header_text
from app.files.machines import load_machine, shipped_machines
from app.files.runs import POINTS, write_run, write_texts
from app.files.shipped_maps import shipped_map
from app.files.text import read_text
from app.jobs.chosen_runs import File, Runs, names_of, path_of
from app.jobs.fitting import RemarkEntry
from app.jobs.record import Report
from calib.errors import BadInput
from calib.identify.staged import fit_effects
from calib.identify.starting import NOWHERE
from calib.look import first_look
from calib.look.conventions import Misread
from calib.look.judged import record_of
from calib.mechanism.description import Machine
from calib.runs import format_run, parse_header, parse_run
from calib.runs.header import Header
from calib.runs.record import Run
from calib.runs.remark import Remark, plain_remarks
from calib.runs.sensing import Setup

MAP_COPY = "import-map.toml"
_WHERE = {
    "position": "[[reading]] (unit, sign, the order of columns)",
    "nests": "[nests]",
    "q": "[actuators] (unit, sign, gear, offset, the order of columns)",
}


@dataclass(frozen=True, kw_only=True)
class ImportReport(Report):
    """What was brought in (``pkm-imported/1``).

    ``runs`` are the folders, one a station; ``assumed`` what neither the map nor the files state,
    or was left out; ``record`` what the data themselves say is wrong. The same stands in run.toml.
    """

    FORMAT: ClassVar[str] = "pkm-imported/1"
    runs: tuple[str, ...]
    machine: str
    map: str
    rows: int
    readings: int
    poses: int
    assumed: tuple[str, ...]
    record: tuple[RemarkEntry, ...]


def import_run(
    files: Runs,
    map: str | File,  # noqa: A002 - the verb's own word
    run: File,
    *,
    machine: str | None = None,
    header: File | None = None,
    commands: File | None = None,
    as_it_stands: bool = False,
) -> ImportReport:
    """Bring tables to a run, by a map that says what their columns are.

    Parameters
    ----------
    files : path or sequence of paths
        Tables of one layout, in the order in which they were measured.
    map : str or path
        A map's file, or the name of one that ships.
    run : path
        Folder to write, which holds no run yet; a folder in it for each of several stations.
    machine : str, optional
        A machine file or the name of a shipped machine, in place of the one that the map names.
    header : path, optional
        A ``run.toml`` with machine, nests and load, where the map holds none.
    commands : path, optional
        What was commanded, where the map says that it stands in a file of its own.
    as_it_stands : bool
        Write the run even where the data prove that its numbers were written in another way.

    Returns
    -------
    ImportReport

    Raises
    ------
    BadInput
        With file, line and column; also where the data prove that units, signs, axes or frames are
        not what the map says.

    Examples
    --------
    >>> pkmcal.import_run("points.txt", "spatial-analyzer", "run",           # doctest: +SKIP
    ...     header="machine-and-nests.toml", commands="joints.csv").readings
    183
    """
    names, out = names_of(files), Path(run)
    text, source, folder = _map_text(map)
    plan = parse_map(text, source)
    head, described, base = _header(plan, machine, path_of(header), folder)
    found = _read(names, path_of(commands), plan, described, head)
    for station, one in found.runs.items():
        if station not in found.points:
            _prove(one, described)
    assumed = [*found.assumed, *_assumed_of_map(plan, found)]
    looked = [one if found.lines_of_file else _lines_of_run(one) for one in found.runs.values()]
    remarks = _looked(described, looked, plan, as_it_stands=as_it_stands)
    said = _said_in_run(names, path_of(commands), source, text, assumed)
    folders = []
    for station, one in found.runs.items():
        place = out / _folder_name(station) if len(found.runs) > 1 else out
        named = _named_from(place, head.machine, base)
        if station in found.points:
            top = header_text(named, _tables(text, path_of(header)))
            write_texts(place, top, found.points[station], beside={"imported": said})
        else:
            known = replace(one, header=replace(one.header, machine=named))
            write_run(place, known, beside={"imported": said})
        (place / MAP_COPY).write_text(text, encoding="utf-8", newline="\n")
        folders.append(str(place))
    poses = {
        label
        for one in found.runs.values()
        for label, nest in zip(one.pose, one.nest, strict=True)
        if label and nest
    }
    report = {
        "format": ImportReport.FORMAT,
        "runs": folders,
        "machine": head.machine,
        "map": source,
        "rows": sum(one.line.size for one in found.runs.values()),
        "readings": sum(one.readings for one in found.runs.values()),
        "poses": len(poses),
        "assumed": assumed,
        "record": plain_remarks(remarks),
    }
    return ImportReport.of(report)


def _map_text(name: str | File) -> tuple[str, str, Path | None]:
    """A map's text, what it is called, and the folder from which its machine is named."""
    path = Path(name)
    if path.suffix == ".toml" or path.is_file():
        return read_text(path), str(path), path.parent
    return shipped_map(str(name)), f"{name}.toml (shipped)", None


def _tables(text: str, header: Path | None) -> dict[str, Any]:
    """What run.toml takes over as it stands: of the header's file, and of the map."""
    own = tomllib.loads(text)
    if header is None:
        return own
    said = tomllib.loads(read_text(header))
    for key in ("instruments", "planes"):
        if key in own:
            said[key] = {**said.get(key, {}), **own[key]}
    return said


def _header(
    plan: ImportMap, machine: str | None, file: Path | None, folder: Path | None
) -> tuple[Header, Machine, Path | None]:
    """What run.toml will say, the machine, and the folder from which its name counts."""
    head = plan.header
    if file is not None:
        head = parse_header(read_text(file), source=str(file))
        if plan.machine:
            head = replace(head, machine=plan.machine)
        else:
            folder = file.parent
    if head is None:
        raise BadInput(
            "the map says nothing of the nests", place=plan.source,
            remedy="Add machine, [nests.platform] and [nests.base] as in a run.toml, or name a "
            "run.toml that has them with --header",
        )  # fmt: skip
    if plan.setup is not None and file is not None:
        known = head.setup or Setup()
        instruments = {**known.instruments, **plan.setup.instruments}
        planes = {**known.planes, **plan.setup.planes}
        head = replace(head, setup=Setup(instruments, planes, known.nests))
    if machine is not None:
        head, folder = replace(head, machine=machine), None
    described = load_machine(head.machine, folder)
    parameters = {parameter.name for parameter in described.parameters}
    for name in head.controller_parameters:
        if name not in parameters:
            raise BadInput(
                f"the machine has no parameter {name!r}",
                place=plan.source,
                remedy="pkmcal machine check lists them",
            )
    return head, described, folder


def _named_from(folder: Path, machine: str, base: Path | None) -> str:
    """How a run's folder names the machine: a file's path counts from there."""
    path = (base or Path()) / machine
    if machine in shipped_machines() or not path.is_file():
        return machine
    try:
        return Path(os.path.relpath(path.resolve(), folder.resolve())).as_posix()
    except ValueError:  # on another drive
        return path.resolve().as_posix()


def _read(
    names: Sequence[str], commands: Path | None, plan: ImportMap, machine: Machine, head: Header
) -> Imported:
    if not names:
        raise BadInput("no file is named", remedy="Name what is to be imported")
    tables = [read_foreign(Path(name), plan.layout) for name in names]
    for table in tables[1:]:
        if table.names != tables[0].names or table.width != tables[0].width:
            raise BadInput(
                f"its columns are not those of {tables[0].source}", place=table.source,
                remedy="Import files of one layout together",
            )  # fmt: skip
    if (plan.commands is None) != (commands is None):
        raise BadInput(
            "the map says that commands stand in a file of their own, and none is named"
            if commands is None
            else f"{plan.source} has no [commands] for this file",
            place="--commands",
            remedy="Name the file with --commands"
            if commands is None
            else "Add [commands.pose], or leave --commands out",
        )
    told = None
    if commands is not None and plan.commands is not None:
        told = read_foreign(commands, plan.commands.layout)
    return imported(tables, told, plan, machine, head)


def _assumed_of_map(plan: ImportMap, found: Imported) -> list[str]:
    """What the map states of all readings alike."""
    sigma = plan.sigma
    said = []
    if sigma.value is not None:
        size = f"{1000 * sigma.value / sigma.coverage:g} um"
        far = f" and {1e6 * sigma.per_distance / sigma.coverage:g} um/m" * bool(sigma.per_distance)
        said.append(
            f"every reading is uncertain by {size}{far} per axis (1 sigma), as the map says"
        )
    if sigma.coverage != 1.0:
        said.append(f"stated uncertainties are {sigma.coverage:g} sigma")
    if plan.pose.same_joints:
        said.append("the same actuator coordinates are one pose")
    if plan.pose.each_row:
        said.append("every row is a pose of its own, labelled by its line")
    if len(found.runs) > 1:
        said.append(f"{len(found.runs)} stations: a run each, as each has a frame of its own")
    return said


def _prove(run: Run, machine: Machine) -> None:
    """Read the run as its files will be read; raises BadInput for what the format refuses."""
    header_text, points_text = format_run(run)
    parse_run(header_text, points_text, actuators=len(machine.actuators))


def _lines_of_run(run: Run) -> Run:
    return replace(run, source=POINTS, line=np.arange(run.line.size, dtype=np.int64) + 2)


def _looked(
    machine: Machine, runs: Sequence[Run], plan: ImportMap, *, as_it_stands: bool
) -> list[Remark]:
    """What the data say of themselves; raises Misread where they prove the map wrong."""
    try:
        rows = first_look(machine, runs)
        return list(record_of(fit_effects(rows, [])))
    except Misread as wrong:
        where = f"{wrong.remedy}. In {plan.source}: {_WHERE[wrong.of]}"
        if not as_it_stands:
            raise BadInput(wrong.what, place=wrong.place, remedy=where) from wrong
        return [_remark("misread", wrong.what, where, runs[0].source)]
    except BadInput as wrong:
        remedy = (
            "No analysis can use the run before. Other units, signs, orders of axes and a mirrored "
            "frame fit no better: rows of another machine, or another nest table, look like this"
            if NOWHERE in wrong.what
            else "No analysis can use the run before"
        )
        return [_remark("no-fit", str(wrong), remedy, runs[0].source)]


def _remark(name: str, says: str, remedy: str, source: str) -> Remark:
    return Remark(
        name, says, (), "The readings were laid beside the nominal machine",
        "Written as it stands", remedy, False, source,
    )  # fmt: skip


def _folder_name(station: str) -> str:
    kept = "".join(sign if sign.isalnum() or sign in "-_." else "-" for sign in station)
    return kept.strip(".") or "station"


def _said_in_run(
    names: Sequence[str], commands: Path | None, source: str, text: str, assumed: Sequence[str]
) -> dict[str, Any]:
    """The table ``[imported]`` of run.toml."""
    read = [Path(name) for name in names] + ([commands] if commands else [])
    return {
        "files": [
            {"name": path.name, "sha256": hashlib.sha256(path.read_bytes()).hexdigest()}
            for path in read
        ],
        "map": source,
        "map_sha256": hashlib.sha256(text.encode()).hexdigest(),
        "program": f"pkmcal {version('pkmcal')}",
        "assumed": list(assumed),
    }
