"""What was commanded at each row of a foreign table: actuators, poses, or a table of their own."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from datetime import datetime

import numpy as np

from app.files.foreign_table import ForeignTable
from app.files.import_columns import ALL_ACTUATORS, Numbers
from app.files.import_map import Commanded, ImportMap
from app.files.import_values import Reader
from calib.arrays import Array, BoolArray
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.mechanism.rigid import Poses
from calib.mechanism.solve import inverse
from calib.runs.header import Header


@dataclass(frozen=True)
class Row:
    """One row of ``points.csv`` to be; without a nest a move.

    ``cells`` are the columns of a reading that is no point, by name.
    """

    line: int
    place: str
    moment: float | datetime
    station: str
    pose: str
    nest: str
    q: Array
    position: Array | None
    covariance: Array | None
    channels: dict[str, float]
    kind: str = "point"
    instrument: str = ""
    cells: Mapping[str, float] | None = None
    nest2: str = ""
    plane: str = ""


def told_by_pose(
    commands: ForeignTable, plan: ImportMap, machine: Machine, header: Header, notes: list[str]
) -> dict[str, Array]:
    """What was commanded (n,) by the label of the pose."""
    assert plan.commands is not None
    reader = Reader(commands, notes)
    labels = reader.labels(plan.commands.pose)
    q = coordinates(reader, plan, machine, header)
    told: dict[str, Array] = {}
    for row, label in enumerate(labels):
        if not label:
            continue
        if label in told and not np.array_equal(told[label], q[:, row], equal_nan=True):
            raise BadInput(
                f'the label "{label}" stands for two commands', place=commands.place(row, 0),
                remedy="Give every commanded pose a label of its own",
            )  # fmt: skip
        told[label] = q[:, row]
    return told


def coordinates(reader: Reader, plan: ImportMap, machine: Machine, header: Header) -> Array:
    """Actuator coordinates (n, N); nan where a row has none."""
    if plan.commanded is not None:
        return _from_poses(reader, plan.commanded, machine, header)
    wanted: Numbers | None = plan.actuators
    assert wanted is not None
    units = [actuator.unit for actuator in machine.actuators]
    if wanted.columns == (ALL_ACTUATORS,):
        wanted = wanted.for_each([f"q{number + 1}" for number in range(len(units))])
    if len(wanted.columns) != len(units):
        raise BadInput(
            f"{len(wanted.columns)} columns are named for {len(units)} actuators",
            place=wanted.place,
            remedy=f"Name one for each of {', '.join(a.name for a in machine.actuators)}",
        )
    return reader.numbers(wanted, units)


def rotations_of(reader: Reader, wanted: Numbers, rotation: str, good: BoolArray) -> Array:
    """Rotations (3, 3, N) by the numbers of a pose; the unit matrix where ``good`` is False.

    Raises
    ------
    BadInput
        For a quaternion that is not of norm 1.
    """
    from scipy.spatial.transform import Rotation

    turn = reader.numbers(wanted).T
    turn = np.where(good[:, None], turn, np.eye(1, turn.shape[1]))
    if rotation == "rotation vector":
        found = Rotation.from_rotvec(turn)
    elif rotation.startswith("quaternion"):
        off = np.abs(np.linalg.norm(turn, axis=1) - 1.0)
        if off.max() > 1e-3:
            row = int(np.argmax(off))
            at = reader.at(wanted.columns[0], wanted.place)
            raise BadInput(
                f"the quaternion has the norm {np.linalg.norm(turn[row]):.6g}",
                place=reader.table.place(row, at),
                remedy="A rotation has a quaternion of norm 1: see the order of its columns",
            )
        found = Rotation.from_quat(turn, scalar_first=rotation.endswith("wxyz"))
    else:
        found = Rotation.from_euler(rotation, turn)
    return np.moveaxis(found.as_matrix(), 0, -1).copy()


def _from_poses(reader: Reader, wanted: Commanded, machine: Machine, header: Header) -> Array:
    """What the controller commands for poses, by its own parameters."""
    place = reader.numbers(wanted.place_numbers)
    there = np.concatenate([place, reader.numbers(wanted.turn_numbers)])
    good = np.asarray(np.isfinite(there).all(axis=0), dtype=bool)
    rotation = rotations_of(reader, wanted.turn_numbers, wanted.rotation, good)
    poses = Poses(np.where(good, place, 0.0), rotation)
    found = inverse(machine, poses.take(good), machine.vector(header.controller_parameters))
    if not found.converged.all():
        row = int(np.flatnonzero(good)[np.argmin(found.converged)])
        raise BadInput(
            "the machine cannot take the pose commanded here",
            place=f"{reader.table.source}, line {reader.table.lines[row]}",
            remedy="Check units, the order of the angles and the frame of the commanded poses",
        )
    q = np.full((len(machine.actuators), good.size), np.nan)
    q[:, good] = machine.coordinates(found.extension, header.controller_parameters)
    reader.notes.append(
        "q is what the machine file's machine needs for the commanded poses "
        f"({wanted.rotation}; platform in the base frame)"
    )
    return q


def with_commands(rows: list[Row], header: Header, notes: list[str]) -> list[Row]:
    """Where reference readings have no command, the machine stands where it was sent before."""
    missing = [k for k, row in enumerate(rows) if np.isnan(row.q).any()]
    for k in missing:
        if rows[k].nest and rows[k].nest not in header.base_nests:
            raise BadInput(
                "this reading has no command"
                + (f' (pose "{rows[k].pose}")' if rows[k].pose else ""),
                place=rows[k].place,
                remedy="Expected actuator coordinates in its row, or its pose among the commands",
            )
    if len(missing) == len(rows):
        raise BadInput("no row has a command", place=rows[0].place, remedy="See [actuators]")
    filled = list(rows)
    first = next(row.q for row in rows if not np.isnan(row.q).any())
    last = first
    for k, row in enumerate(rows):
        if np.isnan(row.q).any():
            filled[k] = replace(row, q=last)
        last = filled[k].q
    moves = sum(not rows[k].nest for k in missing)
    kept = [row for k, row in enumerate(filled) if row.nest or k not in set(missing)]
    if len(missing) > moves:
        notes.append(
            f"{len(missing) - moves} reference readings have no command: that of the row before"
        )
    if moves:
        notes.append(f"{moves} rows without reading and command are left out")
    if any(not row.nest for row in kept):
        count = sum(not row.nest for row in kept)
        notes.append(f"{count} rows without a position are kept as moves without a reading")
    return kept
