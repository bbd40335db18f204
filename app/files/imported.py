"""Foreign tables as the rows of runs, by a map; everything that was assumed is listed."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import datetime
from itertools import pairwise

import numpy as np

from app.files.foreign_table import ForeignTable
from app.files.import_commands import (
    Row,
    coordinates,
    rotations_of,
    told_by_pose,
    with_commands,
)
from app.files.import_map import ImportMap, Reading
from app.files.import_values import (
    Reader,
    angles,
    one_number,
    positions,
    seconds_from_start,
    times,
)
from app.files.imported_kinds import points_text
from calib.arrays import Array
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.mechanism.rigid import to_euler
from calib.runs.header import Header
from calib.runs.points import parse_points
from calib.runs.record import Run
from calib.runs.sensing import Setup

_NOTHING = Row(0, "", 0.0, "", "", "", np.zeros(0), None, None, {})
"""A row of which nothing is known yet."""


@dataclass
class Imported:
    """What came of the tables.

    ``runs`` by station ("" where there are none), each row with its line in the file; ``assumed``
    what neither map nor file states, or what was left out.
    """

    runs: dict[str, Run]
    assumed: list[str] = field(default_factory=list)
    lines_of_file: bool = True
    points: dict[str, str] = field(default_factory=dict)
    """Text of points.csv by station, where a run is of version 2."""


def imported(
    tables: Sequence[ForeignTable],
    commands: ForeignTable | None,
    plan: ImportMap,
    machine: Machine,
    header: Header,
) -> Imported:
    """Turn tables into runs.

    Parameters
    ----------
    tables : sequence of ForeignTable
        Of one layout, in the order in which they were measured.
    commands : ForeignTable, optional
        What was commanded, where the map says that it stands in a file of its own.

    Raises
    ------
    BadInput
        With file, line and column.
    """
    notes: list[str] = []
    told = None if commands is None else told_by_pose(commands, plan, machine, header, notes)
    rows: list[Row] = []
    for table in tables:
        rows += _Rows(table, plan, machine, header, told, notes).rows()
    if plan.pose.same_joints:
        rows = _labelled_by_joints(rows, header)
    rows = with_commands(rows, header, notes)
    rows = _in_order(rows, plan, notes)
    stations = list(dict.fromkeys(row.station for row in rows))
    if plan.time.step_s:
        notes.append(f"the file holds no times: rows are {plan.time.step_s:g} s apart")
    runs, points = {}, {}
    for station in stations:
        own = [row for row in rows if row.station == station]
        runs[station] = _run(own, header, tables, plan)
        if header.setup is not None or plan.of_kinds:
            time_s = runs[station].time_s
            points[station] = points_text(own, time_s, tuple(plan.channels))
            runs[station] = _of_kinds(points[station], runs[station], machine)
    return Imported(runs, list(dict.fromkeys(notes)), len(tables) == 1, points)


def _of_kinds(text: str, run: Run, machine: Machine) -> Run:
    """The run of version 2 as its file will be read, with the lines of the foreign file."""
    header = run.header if run.header.setup else replace(run.header, setup=Setup())
    found = parse_points(text, header, actuators=len(machine.actuators), source=run.source)
    return replace(found, line=run.line)


class _Rows:
    """The rows of one table."""

    def __init__(
        self,
        table: ForeignTable,
        plan: ImportMap,
        machine: Machine,
        header: Header,
        told: dict[str, Array] | None,
        notes: list[str],
    ) -> None:
        self.table, self.plan, self.machine, self.header = table, plan, machine, header
        self.told, self.notes = told, notes
        self.reader = Reader(table, notes)
        self.nests = {*header.platform_nests, *header.base_nests}

    def rows(self) -> list[Row]:
        """Every row that the map chooses, a reading each; moves without a reading too."""
        plan, table, reader = self.plan, self.table, self.reader
        count = len(table.rows)
        chosen = self._chosen()
        moments = self._moments()
        stations = reader.labels(plan.station) if plan.station else [""] * count
        poses = reader.labels(plan.pose) if plan.pose.columns else [""] * count
        if plan.pose.each_row:
            poses = [str(line) for line in table.lines]
        nests = reader.labels(plan.nest) if plan.nest else [""] * count
        read = [self._read(one) for one in plan.readings]
        q = self._commands(poses)
        channels = self._channels()
        self._say_what_is_left()
        rows: list[Row] = []
        for row in chosen:
            move = Row(
                line=table.lines[row],
                place=f"{table.source}, line {table.lines[row]}",
                moment=moments[row],
                station=stations[row],
                pose=poses[row],
                nest="",
                q=q[:, row],
                position=None,
                covariance=None,
                channels={name: float(values[row]) for name, values in channels.items()},
            )
            found = []
            for reading, held in zip(plan.readings, read, strict=True):
                part, nest = held[row], reading.nest or nests[row]
                if part is not None:
                    found.append(
                        replace(
                            move,
                            pose="" if nest in self.header.base_nests else poses[row],
                            nest=self._nest(row, nest),
                            position=part.position,
                            covariance=part.covariance,
                            cells=part.cells,
                            kind=part.kind,
                            nest2=part.nest2,
                            plane=part.plane,
                            instrument=reading.instrument,
                        )
                    )
            rows += found or [move]
        return rows

    def _pose_cells(self, reading: Reading) -> dict[str, Array]:
        """Columns (N,) of a measured pose; nan where the row holds none."""
        pose, sigma = reading.pose, self.plan.sigma
        assert pose is not None
        assert sigma.value is not None
        assert sigma.angle is not None
        place = self.reader.numbers(pose.place_numbers)
        there = np.concatenate([place, self.reader.numbers(pose.turn_numbers)])
        good = np.asarray(np.isfinite(there).all(axis=0), dtype=bool)
        if (part := np.flatnonzero(np.isfinite(there).any(axis=0) & ~good)).size:
            raise BadInput(
                "a part of the pose is missing",
                place=f"{self.table.source}, line {self.table.lines[int(part[0])]}",
                remedy="Expected place and attitude whole, or none of them",
            )
        turns = to_euler(rotations_of(self.reader, pose.turn_numbers, pose.rotation, good))
        values = np.where(good, np.concatenate([place, turns]), np.nan)
        spread = [sigma.value / sigma.coverage, sigma.angle / sigma.coverage]
        cells = dict(zip(("x", "y", "z", "rx", "ry", "rz"), values, strict=True))
        return cells | {
            f"s{name}": np.full(good.size, spread[name.startswith("r")]) for name in cells
        }

    def _read(self, reading: Reading) -> "list[Row | None]":
        """What each row holds of one reading, as parts of rows; None where there is nothing."""
        count = len(self.table.rows)
        if reading.kind in ("xyz", "spherical"):
            position, covariance = positions(self.reader, reading, self.plan.sigma)
            return [
                replace(_NOTHING, position=position[:, row], covariance=covariance[:, :, row])
                if self._is_there(row, position[:, row])
                else None
                for row in range(count)
            ]
        if reading.kind == "angles":
            columns = angles(self.reader, reading, self.plan.sigma)
        elif reading.kind == "pose":
            columns = self._pose_cells(reading)
        else:
            columns = one_number(self.reader, reading, self.plan.sigma)
        kind = "point" if reading.kind == "height" else reading.kind
        cells = [self._held(row, columns, reading.kind) for row in range(count)]
        return [
            replace(_NOTHING, cells=one, kind=kind, nest2=reading.nest2, plane=reading.plane)
            if one
            else None
            for one in cells
        ]

    def _held(self, row: int, columns: Mapping[str, Array], kind: str) -> dict[str, float]:
        """What a row holds of a reading that is no point, by name; empty where it is nothing."""
        found = {name: float(v[row]) for name, v in columns.items()}
        none = [name for name, value in found.items() if not math.isfinite(value)]
        if kind == "angles" and not {"azimuth", "elevation"} <= set(none):
            return {n: v for n, v in found.items() if n not in none and n[1:] not in none}
        return {} if none else found

    def _chosen(self) -> list[int]:
        count = len(self.table.rows)
        if self.plan.only is None:
            return list(range(count))
        labels = self.reader.labels(self.plan.only)
        chosen = [row for row in range(count) if labels[row]]
        if not chosen:
            raise BadInput(
                "[only] chooses no row", place=self.plan.only.place, remedy="Correct its pattern"
            )
        if len(chosen) < count:
            self.notes.append(f"[only] leaves out {count - len(chosen)} of {count} rows")
        return chosen

    def _moments(self) -> list[float | datetime]:
        if not self.plan.time.columns:
            step = self.plan.time.step_s
            return [step * row for row in range(len(self.table.rows))]
        found, said = times(self.reader, self.plan.time)
        if said:
            self.notes.append(said)
        return found

    def _commands(self, poses: list[str]) -> Array:
        if self.told is None:
            return coordinates(self.reader, self.plan, self.machine, self.header)
        none = np.full(len(self.machine.actuators), np.nan)
        return np.array([self.told.get(label, none) for label in poses]).T

    def _channels(self) -> dict[str, Array]:
        count = len(self.table.rows)
        return {
            name: np.full(count, one.value)
            if one.numbers is None
            else self.reader.numbers(one.numbers)[0]
            for name, one in self.plan.channels.items()
        }

    def _is_there(self, row: int, position: Array) -> bool:
        there = np.isfinite(position)
        if there.any() and not there.all():
            raise BadInput(
                f"a reading lacks {' and '.join(np.array(['x', 'y', 'z'])[~there])}",
                place=f"{self.table.source}, line {self.table.lines[row]}",
                remedy="Expected a whole position, or none",
            )
        return bool(there.all())

    def _nest(self, row: int, nest: str) -> str:
        if nest in self.nests:
            return nest
        what = f'unknown nest "{nest}"' if nest else "no nest is found in the label of this reading"
        known = ", ".join(sorted(self.nests))
        place = f"{self.table.source}, line {self.table.lines[row]}"
        if self.plan.nest is not None and self.plan.nest.columns:
            at = self.reader.at(self.plan.nest.columns[0], self.plan.nest.place)
            place = self.table.place(row, at)
        raise BadInput(
            what,
            place=place,
            remedy=f"Known are {known}. Add its place under [nests.platform] or [nests.base], its "
            "other name under [nest.names], or choose rows with [only]",
        )

    def _say_what_is_left(self) -> None:
        left = [
            self.table.column_name(at)
            for at in range(self.table.width)
            if at not in self.reader.used
        ]
        if left:
            self.notes.append(f"columns left aside: {', '.join(left)}")
        self.notes.extend(self.table.notes)


def _labelled_by_joints(rows: list[Row], header: Header) -> list[Row]:
    """Label poses by what was commanded: the same actuator coordinates are one pose."""
    seen: dict[tuple[float, ...], str] = {}
    labelled = []
    for row in rows:
        if row.nest in header.base_nests or np.isnan(row.q).any():
            labelled.append(row)
            continue
        key = tuple(np.round(row.q, 9))
        labelled.append(replace(row, pose=seen.setdefault(key, str(len(seen) + 1))))
    return labelled


def _in_order(rows: list[Row], plan: ImportMap, notes: list[str]) -> list[Row]:
    """Rows in the order of their times; raises BadInput where they are not, unless told to."""
    if not plan.time.columns:
        return rows
    back = 0
    for before, now in pairwise(rows):
        if now.station == before.station and now.moment < before.moment:  # type: ignore[operator]
            back += 1
            if not plan.time.sort:
                raise BadInput(
                    f"time goes back from {before.moment} to {now.moment}", place=now.place,
                    remedy="Name the files in the order in which they were measured, or write "
                    "sort = true under [time]",
                )  # fmt: skip
    if back:
        notes.append(f"rows are sorted by their times, which went back {back} times")
        return sorted(rows, key=lambda row: row.moment)
    return rows


def _run(rows: list[Row], header: Header, tables: Sequence[ForeignTable], plan: ImportMap) -> Run:
    if not any(row.nest for row in rows):
        raise BadInput("no row holds a reading", place=rows[0].place, remedy="See [[reading]]")
    nothing = np.full(3, np.nan)
    time_s = np.array(seconds_from_start([row.moment for row in rows]))
    if not plan.time.columns:
        lines = {line: at for at, line in enumerate(dict.fromkeys(row.place for row in rows))}
        time_s = plan.time.step_s * np.array([lines[row.place] for row in rows], dtype=np.float64)
    return Run(
        header=header,
        source=tables[0].source if len(tables) == 1 else "points.csv",
        line=np.array([row.line for row in rows], dtype=np.int64),
        time_s=time_s,
        pose=tuple(row.pose for row in rows),
        nest=tuple(row.nest for row in rows),
        q=np.round(np.array([row.q for row in rows]).T, 12),
        measured=np.array([bool(row.nest) for row in rows]),
        position=np.round(
            np.array([nothing if row.position is None else row.position for row in rows]).T, 9
        ),
        covariance=np.array(
            [np.full((3, 3), np.nan) if row.covariance is None else row.covariance for row in rows]
        ).transpose(1, 2, 0),
        channels={
            name: np.round([row.channels[name] for row in rows], 9) for name in plan.channels
        },
        left_aside={},
    )
