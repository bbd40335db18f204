"""``points.csv``: one row a tracker reading; every fault named with line and column."""

import csv
import re
from collections.abc import Collection, Mapping, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from calib.errors import BadInput
from calib.plain_text import plain
from calib.runs.cells import SMALLEST_SIGMA, channel_in, meant_in
from calib.runs.header import Header, parse_header
from calib.runs.record import Run
from calib.runs.spelling import spelled

Array = NDArray[np.float64]
Cells = list[str]

POSITION = ("x", "y", "z")
SIGMAS = ("sx", "sy", "sz")
COVARIANCES = ("sxy", "sxz", "syz")
# Columns whose meaning is fixed: text in them is a fault, not a remark.
KNOWN_CHANNELS = ("delay_s", "cycle", "structure_temp_C", "air_temp_C", "payload_kg")


def parse_run(
    run_text: str,
    points_text: str,
    *,
    actuators: int,
    units: Sequence[str] = (),
    parameters: Collection[str] | None = None,
    run_source: str = "run.toml",
    points_source: str = "points.csv",
) -> Run:
    """Read both files of a run.

    Parameters
    ----------
    run_text, points_text : str
        Their texts.
    actuators : int
        How many actuators the machine has: columns ``q1`` .. ``qn`` are expected.
    units : sequence of str, optional
        "mm" or "rad" of each actuator, to check units that the header states.
    parameters : collection of str, optional
        The machine's parameter names, to check ``[controller.parameters]``.
    run_source, points_source : str
        The files' names, for messages.

    Raises
    ------
    BadInput
        With file, line, column, what was found and what was expected.
    """
    header = parse_header(run_text, source=run_source, parameters=parameters)
    return parse_points(points_text, header, actuators=actuators, units=units, source=points_source)


def parse_points(
    text: str,
    header: Header,
    *,
    actuators: int,
    units: Sequence[str] = (),
    source: str = "points.csv",
) -> Run:
    """Read ``points.csv`` for a run whose ``run.toml`` is read already; raises BadInput."""
    table = _Table(spelled(text, source, units), source)
    if header.setup is not None:
        from calib.runs.kinds_table import points_of_kinds  # it reads with the helpers of this file

        return points_of_kinds(table, header, header.setup, actuators)
    n_columns = table.actuator_columns(actuators, header.machine)
    table.require(("time_s", "pose", "nest", *n_columns, *POSITION, *SIGMAS))
    nest = tuple(table.cells("nest"))
    measured = np.array([bool(name) for name in nest], dtype=bool)
    _check_nests(table, nest, header)
    time_s = table.numbers("time_s")
    _check_time(table, time_s)
    q = np.array([table.numbers(name) for name in n_columns])
    position = table.readings(POSITION, measured, nest)
    sigma = table.readings(SIGMAS, measured, nest)
    if not measured.any():
        raise BadInput("no row holds a reading", place=source, remedy="Measure before analysing")
    fixed = {"time_s", "pose", "nest", *n_columns, *POSITION, *SIGMAS, *COVARIANCES}
    channels, left_aside = table.channels([name for name in table.names if name not in fixed])
    return Run(
        header=header,
        source=source,
        line=np.array(table.lines, dtype=np.int64),
        time_s=time_s,
        pose=tuple(table.cells("pose")),
        nest=nest,
        q=q,
        measured=measured,
        position=position,
        covariance=_covariances(table, sigma, measured),
        channels=channels,
        left_aside=left_aside,
    )


class _Table:
    """The cells of the file with the line on which each row ends."""

    def __init__(self, text: str, source: str) -> None:
        self.source = source
        text = plain(text)
        if not text.strip():
            raise BadInput(
                "the file is empty", place=f"{source}, line 1", remedy="Expected a header and rows"
            )
        rows = self._rows(text)
        self.names = [name.strip() for name in rows[0][1]]
        self._check_header()
        if len(rows) == 1:
            raise BadInput(
                "the file has a header and no rows",
                place=f"{source}, line 2",
                remedy="Expected one row for each reading",
            )
        self._check_width(rows, ends_whole=text.endswith("\n"))
        self.lines = [line for line, _ in rows[1:]]
        columns = zip(*(cells for _, cells in rows[1:]), strict=True)
        self._columns = {
            name: [cell.strip() for cell in column]
            for name, column in zip(self.names, columns, strict=True)
        }

    def _rows(self, text: str) -> list[tuple[int, Cells]]:
        lines = text.split("\n")
        reader = csv.reader((line + "\n" for line in lines), strict=True)
        rows: list[tuple[int, Cells]] = []
        try:
            # A blank line holds nothing that could be lost.
            rows.extend((reader.line_num, cells) for cells in reader if any(map(str.strip, cells)))
        except csv.Error as error:
            line = min(reader.line_num, len(lines))
            raise BadInput(
                f"not readable as comma-separated values: {error}",
                place=f"{self.source}, line {line}",
                remedy="Look for a quotation mark that is not closed, or a truncated line",
            ) from error
        return rows

    def _check_header(self) -> None:
        for place, name in enumerate(self.names):
            if not name:
                raise BadInput(
                    f"column {place + 1} has no name",
                    place=f"{self.source}, line 1",
                    remedy="Name it or remove it",
                )
            if name in self.names[:place]:
                raise BadInput(
                    f"column {name!r} appears twice",
                    place=f"{self.source}, line 1, column {name}",
                    remedy="Expected every column once",
                )

    def _check_width(self, rows: list[tuple[int, Cells]], *, ends_whole: bool) -> None:
        width, last = len(self.names), len(rows) - 1
        for number, (line, cells) in enumerate(rows[1:], start=1):
            stripped = [cell.strip() for cell in cells]
            if stripped == self.names:
                raise BadInput(
                    "the header is repeated",
                    place=f"{self.source}, line {line}",
                    remedy="Expected a row of numbers; remove this line",
                )
            if len(cells) < width and number == last:
                raise self._truncated(line, self.names[len(cells) - 1], f"{len(cells)} of {width}")
            if len(cells) != width:
                raise BadInput(
                    f"{len(cells)} fields found",
                    place=f"{self.source}, line {line}, column "
                    f"{self.names[min(len(cells), width) - 1]}",
                    remedy=f"Expected {width}, as in the header",
                )
        if not ends_whole and last > 1 and _is_cut([cells[-1].strip() for _, cells in rows[1:]]):
            raise self._truncated(
                rows[last][0], self.names[-1], f"{rows[last][1][-1]!r} at the end"
            )

    def _truncated(self, line: int, column: str, found: str) -> BadInput:
        return BadInput(
            f"the last line is truncated ({found})"
            if "at the end" in found
            else f"the last line is truncated: {found} fields found",
            place=f"{self.source}, line {line}, column {column}",
            remedy="Expected a whole row; copy the file again, or delete this line",
        )

    def actuator_columns(self, wanted: int, machine: str) -> list[str]:
        found = [name for name in self.names if re.fullmatch(r"q[1-9]\d*", name)]
        names = [f"q{number}" for number in range(1, wanted + 1)]
        if len(found) == wanted and set(found) != set(names):
            missing = next(name for name in names if name not in found)
            self.require([missing])
        if len(found) != wanted:
            odd = next((n for n in names if n not in found), found[-1] if found else "q1")
            raise BadInput(
                f"wrong number of actuators: {len(found)} columns q found ({', '.join(found)})",
                place=f"{self.source}, line 1, column {odd}",
                remedy=f"Expected {wanted} for the machine {machine}: {', '.join(names)}",
            )
        return names

    def require(self, wanted: Collection[str]) -> None:
        for name in wanted:
            if name not in self.names:
                like = [other for other in self.names if other.lower() == name.lower()]
                raise BadInput(
                    f"column {name!r} is missing" + (f" (found {like[0]!r})" if like else ""),
                    place=f"{self.source}, line 1, column {name}",
                    remedy=f"Expected the columns time_s, pose, nest, q1.., x, y, z, sx, sy, sz; "
                    f"found {', '.join(self.names)}",
                )

    def cells(self, name: str) -> Cells:
        return self._columns[name]

    def has(self, name: str) -> bool:
        return name in self._columns

    def place(self, row: int, column: str) -> str:
        return f"{self.source}, line {self.lines[row]}, column {column}"

    def wrong(self, row: int, column: str, expected: str) -> BadInput:
        cell = self._columns[column][row]
        return BadInput(
            f"found {cell!r}" if cell else "the field is empty",
            place=self.place(row, column),
            remedy=f"Expected {expected}",
        )

    def numbers(self, name: str) -> Array:
        """Read a column that must hold a finite number on every row."""
        values = np.empty(len(self.lines))
        for row, cell in enumerate(self._columns[name]):
            value = meant_in(cell)
            if value is None:
                raise self.wrong(row, name, "a finite number that can be meant")
            values[row] = value
        return values

    def readings(
        self, names: tuple[str, ...], measured: NDArray[np.bool_], nest: tuple[str, ...]
    ) -> Array:
        """Read columns that are full where a nest is named and empty where none is."""
        values = np.full((len(names), len(self.lines)), np.nan)
        for index, name in enumerate(names):
            for row, cell in enumerate(self._columns[name]):
                if not measured[row]:
                    if cell:
                        raise self.wrong(
                            row, name, "an empty field, since no nest is named: a move only"
                        )
                    continue
                value = meant_in(cell)
                if value is None:
                    raise self.wrong(row, name, f"a finite number in mm (nest {nest[row]})")
                if name in SIGMAS and value < SMALLEST_SIGMA:
                    raise self.wrong(row, name, "a standard uncertainty in mm, larger than zero")
                values[index, row] = value
        return values

    def channels(self, names: list[str]) -> tuple[dict[str, Array], dict[str, str]]:
        channels: dict[str, Array] = {}
        left_aside: dict[str, str] = {}
        for name in names:
            values = [channel_in(cell) for cell in self._columns[name]]
            text = next((row for row, value in enumerate(values) if value is None), None)
            if text is not None and name in KNOWN_CHANNELS:
                raise self.wrong(text, name, "a number, nan or an empty field")
            if text is not None:
                left_aside[name] = f"line {self.lines[text]} holds {self._columns[name][text]!r}"
                continue
            column = np.array(values, dtype=np.float64)
            if name == "delay_s" and bool(np.any(column < 0)):
                raise self.wrong(int(np.argmax(column < 0)), name, "a delay in s, not negative")
            channels[name] = column
        return channels, left_aside


def _is_cut(column: Cells) -> bool:
    """Tell whether the last cell was cut: shorter than a column of fixed decimals, or empty."""
    *others, last = column
    if not last:
        return all(others)
    numbers = [cell for cell in others if cell and cell.lower() != "nan"]
    decimals = {len(cell.partition(".")[2]) for cell in numbers}
    return len(decimals) == 1 and len(last.partition(".")[2]) < max(decimals)


def _check_nests(table: _Table, nest: tuple[str, ...], header: Header) -> None:
    known = [*header.platform_nests, *header.base_nests]
    for row, name in enumerate(nest):
        if name and name not in known:
            raise BadInput(
                f"unknown nest {name!r}",
                place=table.place(row, "nest"),
                remedy=f"Expected one of {', '.join(known)} (run.toml), or an empty field",
            )


def _check_time(table: _Table, time_s: Array) -> None:
    for row, (before, now) in enumerate(pairwise(time_s), start=1):
        if now < before:
            raise BadInput(
                f"time goes back from {before:g} to {now:g} s",
                place=table.place(row, "time_s"),
                remedy="Expected rows in the order in which they were taken"
                + _why_back(before, now),
            )


def _why_back(before: float, now: float) -> str:
    """What clocks and people do that makes a time go back by so much."""
    by = before - now
    if 3000.0 < by < 3600.0:
        return "; was the clock put back by an hour (summer time)? Then add 3600 s from there on"
    if 72000.0 < by < 86400.0 and now < 14400.0:
        return "; is it the time of day, and past midnight there? Then add 86400 s from there on"
    if now < 0.05 * before:
        return (
            "; time begins anew there: were two files joined? Then give each as a run of its own "
            "(pkmcal fit RUN RUN)"
        )
    return ""


def _covariances(table: _Table, sigma: Array, measured: NDArray[np.bool_]) -> Array:
    """Full covariance (3, 3, N) from the sigmas and the optional off-diagonal columns."""
    covariance = np.zeros((3, 3, sigma.shape[1]))
    for axis in range(3):
        covariance[axis, axis] = sigma[axis] ** 2
    pairs: Mapping[str, tuple[int, int]] = {"sxy": (0, 1), "sxz": (0, 2), "syz": (1, 2)}
    given = [name for name in pairs if table.has(name)]
    for name in given:
        first, second = pairs[name]
        for row, cell in enumerate(table.cells(name)):
            value = meant_in(cell) if cell else 0.0
            if value is None:
                raise table.wrong(row, name, "a covariance in mm^2, or an empty field")
            covariance[first, second, row] = covariance[second, first, row] = value
    rows = np.flatnonzero(measured)
    if given and rows.size:
        scale = sigma[:, rows]
        correlation = covariance[:, :, rows] / (scale[:, None] * scale[None, :])
        smallest = np.linalg.eigvalsh(np.moveaxis(correlation, -1, 0))[:, 0]
        for row in rows[smallest <= 1e-9]:
            raise BadInput(
                "the covariance matrix is not positive definite",
                place=table.place(int(row), ", ".join(given)),
                remedy="Expected covariances in mm^2 with |sxy| < sx sy and so on",
            )
    covariance[:, :, ~measured] = np.nan
    return covariance
