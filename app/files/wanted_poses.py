"""Tables of wanted poses: coordinates, and whatever else is known at each of them.

::

    pose,x,y,z,rx,ry,rz,payload_kg,time_s
    1,10.0,-5.0,221.5,0.05,-0.1,0.2,5.0,30

The machine's task coordinates or all six, mm and rad, or in the unit that stands in the head
(``rx [deg]``) or behind a number (``5 deg``); any other column of numbers is a channel.
Lines that start with # are remarks. The format is described in docs/correct.md.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from app.files.poses import read_pose_file
from app.files.unit_columns import Column, column, table_lines
from calib.arrays import Array
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.mechanism.rigid import Poses
from calib.mechanism.task import FULL, task_values

NAME, TIME = "pose", "time_s"


@dataclass(frozen=True, eq=False)
class Wanted:
    """N wanted poses in the order in which they are visited.

    ``task`` (k, N) in mm and rad; ``channels`` (N,) by name; ``time_s`` (N,) or None.
    """

    names: tuple[str, ...]
    task: Array
    channels: Mapping[str, Array] = field(default_factory=dict)
    time_s: Array | None = None


def read_wanted(path: Path, machine: Machine) -> Wanted:
    """Read a table that ends in ``.csv``, or a poses file; raises BadInput with the place."""
    if path.suffix.lower() != ".csv":
        found = read_pose_file(path, machine)
        return Wanted(found.labels, found.pose_set.task)
    lines = list(table_lines(path))
    own = machine.task.coordinates
    if len(lines) < 2:
        raise BadInput(
            "there is no pose", place=str(path), remedy=f"Write a header {_header(own)} and rows"
        )
    place, header = lines[0]
    measures = {name: "mm" if name in "xyz" else "rad" for name in (*own, *FULL)}
    heads = [column(cell, measures, place) for cell in header]
    names = [head.name for head in heads]
    _check_header(names, own, place)
    labels: list[str] = []
    rows: list[dict[str, float]] = []
    for place, cells in lines[1:]:
        label, values = _row(cells, heads, place)
        labels.append(label or str(len(labels) + 1))
        rows.append(values)
    columns = {name: np.array([row[name] for row in rows]) for name in names if name != NAME}
    return _as_wanted(labels, columns, machine)


def _as_wanted(labels: list[str], columns: dict[str, Array], machine: Machine) -> Wanted:
    own = machine.task.coordinates
    if all(name in columns for name in own):
        task = np.stack([columns[name] for name in own])
    else:
        whole = Poses.from_xyz_rpy(np.stack([columns[name] for name in FULL]))
        task = task_values(machine.task, whole)
    other = {k: v for k, v in columns.items() if k not in (*own, *FULL, TIME)}
    return Wanted(tuple(labels), task, other, columns.get(TIME))


def _header(own: tuple[str, ...]) -> str:
    return ",".join((NAME, *own))


def _check_header(names: list[str], own: tuple[str, ...], place: str) -> None:
    twice = [name for name in names if names.count(name) > 1]
    if twice or "" in names:
        what = f"the column {twice[0]!r} is there twice" if twice and twice[0] else "no name"
        raise BadInput(what, place=place, remedy="Give every column a name of its own")
    if not set(own) <= set(names) and not set(FULL) <= set(names):
        missing = next(name for name in own if name not in names)
        raise BadInput(
            f"there is no column {missing}", place=place, remedy=f"Write {_header(own)}, ..."
        )


def _row(cells: Sequence[str], heads: list[Column], place: str) -> tuple[str, dict[str, float]]:
    if len(cells) != len(heads):
        raise BadInput(
            f"{len(cells)} cells under {len(heads)} columns", place=place, remedy="Complete it"
        )
    label, values = "", {}
    for head, cell in zip(heads, cells, strict=True):
        name = head.name
        if name == NAME:
            label = cell
        else:
            values[name] = head.number(cell, place)
    return label, values
