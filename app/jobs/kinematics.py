"""Poses of commanded actuators, and actuators of wanted poses: the geometry alone."""

import csv
import io
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from app.files.fits import SavedFit, read_fit
from app.files.machines import load_machine
from app.files.unit_columns import Column, column, table_lines
from app.jobs.chosen_runs import File, path_of
from app.jobs.record import Record, Report
from calib.arrays import Array
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.mechanism.limits import violations
from calib.mechanism.rigid import Poses
from calib.mechanism.solve import Configuration, forward, inverse
from calib.mechanism.task import FULL, task_values

LABEL = "pose"


@dataclass(frozen=True, kw_only=True)
class PlaceEntry(Record):
    """One line: actuators (mm, rad) and the pose x, y, z, rx, ry, rz (mm, rad) that go together.

    Where the machine does not close there, or a limit is passed, ``why`` says so; q and pose are
    None where it does not close.
    """

    pose_name: str
    q: tuple[float, ...] | None
    pose: tuple[float, ...] | None
    closes: bool
    why: str


@dataclass(frozen=True, kw_only=True)
class KinematicsReport(Report):
    """Poses and actuators of a machine (``pkm-kinematics/1``), mm and rad."""

    FORMAT: ClassVar[str] = "pkm-kinematics/1"
    machine: str
    model: str
    direction: str
    actuators: tuple[str, ...]
    units: tuple[str, ...]
    places: tuple[PlaceEntry, ...]

    def table(self, *, degrees: bool = False) -> str:
        """CSV of the answer; with ``degrees`` angles are in degrees."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        heads = _heads(self.actuators, self.units) if self.direction == "inverse" else _POSE_HEADS
        angle = "deg" if degrees else "rad"
        writer.writerow([LABEL, *(f"{name} [{unit or angle}]" for name, unit in heads), "why"])
        for one in self.places:
            values = one.q if self.direction == "inverse" else one.pose
            cells = ["" for _ in heads]
            if values is not None:
                cells = [
                    f"{np.rad2deg(v) if degrees and not unit else v:.12g}"
                    for v, (_, unit) in zip(values, heads, strict=True)
                ]
            writer.writerow([one.pose_name, *cells, one.why])
        return text.getvalue()


_POSE_HEADS = tuple((name, "mm" if name in "xyz" else "") for name in FULL)


def _heads(names: Sequence[str], units: Sequence[str]) -> tuple[tuple[str, str], ...]:
    return tuple((n, "mm" if u == "mm" else "") for n, u in zip(names, units, strict=True))


def kinematics(
    machine: str | os.PathLike[str],
    file: File,
    direction: Literal["forward", "inverse"],
    *,
    model: File | None = None,
) -> KinematicsReport:
    """Poses of actuators in a file, or actuators of poses.

    Parameters
    ----------
    machine : str
        A shipped machine, or a machine file.
    file : path
        CSV: a column for each actuator (``forward``), or x, y, z, rx, ry, rz or the machine's own
        coordinates (``inverse``); units in the heads or behind the numbers, else mm and rad; a
        column ``pose`` of labels may be there.
    direction : "forward" or "inverse"
    model : path, optional
        A saved model: its geometry, and what the controller held. Effects are not in it; see
        :func:`correct`.

    Returns
    -------
    KinematicsReport

    Raises
    ------
    BadInput
        Naming file, line and column.

    Examples
    --------
    >>> there = pkmcal.kinematics("arm", "q.csv", "forward")                 # doctest: +SKIP
    >>> there.places[0].pose                                                 # doctest: +SKIP
    (501.57, 0.0, 833.43, 0.0, 0.785, 0.0)
    """
    described = load_machine(os.fspath(machine))
    saved = None if model is None else read_fit(Path(model))
    parameters, controller = _geometry(described, saved)
    path = path_of(file)
    assert path is not None
    given = {a.name: a.unit for a in described.actuators} if direction == "forward" else _poses()
    own = described.task.coordinates
    allowed = {**given, **({c: _unit(c) for c in own} if direction == "inverse" else {})}
    labels, columns = _read(path, allowed)
    if direction == "forward":
        _lacking(path, columns, tuple(given))
        q = np.stack([columns[name] for name in given])
        found = forward(described, described.extension(q, controller), parameters)
    else:
        found = inverse(described, _wanted(path, columns, described), parameters)
    return KinematicsReport.of(
        {
            "format": KinematicsReport.FORMAT,
            "machine": described.name,
            "model": "" if saved is None else saved.source,
            "direction": direction,
            "actuators": [a.name for a in described.actuators],
            "units": [a.unit for a in described.actuators],
            "places": _places(described, controller, labels, found),
        }
    )


def _unit(name: str) -> str:
    return "mm" if name in "xyz" else "rad"


def _poses() -> dict[str, str]:
    return {name: _unit(name) for name in FULL}


def _geometry(machine: Machine, saved: SavedFit | None) -> tuple[Array, Mapping[str, float]]:
    """Parameters (P,) and what the controller holds; nominal where a model is silent."""
    if saved is None:
        return machine.nominal, {}
    known = {p.name for p in machine.parameters}
    found = {name: one.value for name, one in saved.estimates.items() if name in known}
    if not found:
        raise BadInput(
            f'the model is of "{saved.machine}" and has no parameter of "{machine.name}"',
            place=saved.source,
            remedy="Name the machine that the model is of",
        )
    return machine.vector(found), saved.controller


def _read(path: Path, measures: dict[str, str]) -> tuple[list[str], dict[str, Array]]:
    """Labels, and columns by name in mm and rad; columns of other names are left alone."""
    lines = list(table_lines(path))
    if len(lines) < 2:
        raise BadInput(
            "there is no row", place=str(path), remedy=f"Write a header {','.join(measures)}"
        )
    place, heads = lines[0]
    columns: list[Column] = [column(head, measures, place) for head in heads]
    names = [one.name for one in columns]
    twice = [name for name in names if names.count(name) > 1]
    if twice:
        raise BadInput(
            f"the column {twice[0]!r} is there twice", place=place, remedy="Remove one of them"
        )
    labels: list[str] = []
    values: dict[str, list[float]] = {one.name: [] for one in columns if one.measures}
    for where, cells in lines[1:]:
        if len(cells) != len(columns):
            raise BadInput(
                f"{len(cells)} cells under {len(columns)} columns",
                place=where,
                remedy="Complete it",
            )
        given = dict(zip(names, cells, strict=True))
        labels.append(given.get(LABEL) or str(len(labels) + 1))
        for one in columns:
            if one.measures:
                values[one.name].append(one.number(given[one.name], where))
    return labels, {name: np.array(listed) for name, listed in values.items()}


def _lacking(path: Path, columns: Mapping[str, Array], wanted: Sequence[str]) -> None:
    missing = [name for name in wanted if name not in columns]
    if missing:
        raise BadInput(
            f"there is no column {missing[0]}",
            place=str(path),
            remedy=f"Write columns {', '.join(wanted)}",
        )


def _wanted(path: Path, columns: Mapping[str, Array], machine: Machine) -> Array:
    own = machine.task.coordinates
    if all(name in columns for name in own):
        return np.stack([columns[name] for name in own])
    _lacking(path, columns, FULL)
    whole = Poses.from_xyz_rpy(np.stack([columns[name] for name in FULL]))
    return task_values(machine.task, whole)


def _places(
    machine: Machine, controller: Mapping[str, float], labels: Sequence[str], found: Configuration
) -> list[dict[str, Any]]:
    passed: dict[int, str] = {}
    for one in violations(machine, found):
        value = one.value if one.unit == "mm" else float(np.rad2deg(one.value))
        unit = one.unit if one.unit == "mm" else "deg"
        passed.setdefault(one.pose, f"{one.what} passes its limit: {value:.6g} {unit}")
    q = machine.coordinates(found.extension, controller)
    poses = found.poses.to_xyz_rpy()
    places = []
    for k, label in enumerate(labels):
        closes = bool(found.converged[k])
        places.append(
            {
                "pose_name": label,
                "q": [float(v) for v in q[:, k]] if closes else None,
                "pose": [float(v) for v in poses[:, k]] if closes else None,
                "closes": closes,
                "why": passed.get(k, "") if closes else "the machine does not close there",
            }
        )
    return places
