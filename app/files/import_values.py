"""Cells of a foreign table as values of a run: numbers in their units, times, labels, positions."""

import math
import re
from collections.abc import Sequence
from datetime import datetime, timedelta

import numpy as np

from app.files.foreign_table import ForeignTable
from app.files.import_columns import Numbers, Text
from app.files.import_map import Reading, Time
from app.files.import_sigma import Sigma
from app.files.time_forms import are_days, form_of
from calib.arrays import Array, BoolArray
from calib.errors import BadInput
from calib.units import Unit, unit_named

DAY_S = 86400.0
_CLOCK = re.compile(r"(\d{1,2}):(\d{2})(?::(\d{2}(?:[.,]\d+)?))?\s*([AaPp][Mm])?")


class Reader:
    """The columns of one table by a map; ``notes`` collects what is said of their units."""

    def __init__(self, table: ForeignTable, notes: list[str]) -> None:
        self.table = table
        self.notes = notes
        self.used: set[int] = set()

    def at(self, column: int | str, place: str) -> int:
        """Where a column stands; it counts as used."""
        index = self.table.index(column, place)
        self.used.add(index)
        return index

    def numbers(self, wanted: Numbers, base: Sequence[str] = ()) -> Array:
        """Values (k, N) in the program's units; nan where a cell says that there is nothing.

        ``base`` replaces what the map cannot know: the units of the machine's actuators.

        Raises
        ------
        BadInput
            For a unit that nobody states, or that map and file state differently.
        """
        rows = range(len(self.table.rows))
        values = np.empty((len(wanted.columns), len(rows)))
        for k, column in enumerate(wanted.columns):
            at = self.at(column, wanted.place)
            own = base[k] if base else wanted.base[k]
            scale, per = wanted.scale[k] if wanted.scale else (1.0, "")
            unit = self._unit(wanted, k, at, own, per)
            raw = [unit.convert(self.table.number(row, at)) for row in rows]
            values[k] = wanted.sign[k] * scale * np.array(raw) / wanted.gear[k] + wanted.offset[k]
        return values

    def _unit(self, wanted: Numbers, k: int, at: int, base: str, per: str) -> Unit:
        """The unit of a column; where ``scale`` says what a count is, there is none."""
        stated, of = self.table.units[at], base
        if per:
            above, _, below = per.partition("/")
            if base and above != base:
                raise BadInput(
                    f"scale is in {per}, and {base} is wanted", place=wanted.place,
                    remedy=f'Write what one count is: scale = "0.001 {base}"',
                )  # fmt: skip
            of = below or "1"
        own = wanted.units[k]
        if own is None and stated:
            line = self.table.header_line or self.table.lines[0]
            place = f"{self.table.source}, line {line}, column {self.table.column_name(at)}"
            return unit_named(stated, place, of)
        if own is None and of in ("1", ""):
            return Unit(of, 1.0)
        if own is None:
            raise BadInput(
                f'nothing says the unit of column "{self.table.column_name(at)}"',
                place=wanted.place,
                remedy=f'Write unit = "{of}" (or another), or "{self.table.column_name(at)}[{of}]" '
                "in the header",
            )
        if of and own.base != of:
            raise BadInput(
                f'column "{self.table.column_name(at)}" is stated in a unit of {own.base}, '
                f"and {of} is wanted",
                place=wanted.place,
                remedy="Correct unit in the map",
            )
        if stated and unit_named(stated, self.table.source) != own:
            raise BadInput(
                f'the header of column "{self.table.column_name(at)}" says {stated}, the map '
                "another unit",
                place=wanted.place,
                remedy="Remove unit from the map, or correct the header",
            )
        return own

    def labels(self, wanted: Text) -> list[str]:
        """The label of every row; "" where there is none."""
        columns = [self.at(column, wanted.place) for column in wanted.columns]
        return [
            wanted.label(
                [self.table.text(row, at) for at in columns],
                self.table.place(row, columns[0]) if columns else wanted.place,
            )
            for row in range(len(self.table.rows))
        ]


def times(reader: Reader, wanted: Time) -> tuple[list[float | datetime], str]:
    """The times of all rows, s or date and time, and what is said of them.

    Raises
    ------
    BadInput
        With line and column, for what is no such time.
    """
    table = reader.table
    columns = [reader.at(column, wanted.place) for column in wanted.columns]
    if wanted.form in ("s", "excel"):
        at, days = columns[0], wanted.form == "excel"
        stated = table.units[at]
        unit = wanted.unit or unit_named(stated or "s", table.source, "s")
        found_at = [_number_of_time(table, row, at) for row in range(len(table.rows))]
        if not (days or wanted.unit or stated) and are_days(found_at):
            raise BadInput(
                f"found {table.text(0, at)!r}: these are Excel's dates, days since 1900, not s",
                place=table.place(0, at),
                remedy='Write form = "excel" under [time] of the map (or unit = "s")',
            )
        values = [DAY_S * one if days else unit.convert(one) for one in found_at]
        for row, value in enumerate(values):
            if not math.isfinite(value):
                raise BadInput(
                    "the field is empty", place=table.place(row, at), remedy="Add a time"
                )
        said = (
            "" if days or wanted.unit or stated else "times are in s: neither map nor file says it"
        )
        return list(values), said
    texts = [
        " ".join(table.text(row, at) for at in columns).strip() for row in range(len(table.rows))
    ]
    places = [table.place(row, columns[0]) for row in range(len(table.rows))]
    if wanted.form == "clock":
        return _clock(texts, places)
    found = [_moment(text, wanted.form, place) for text, place in zip(texts, places, strict=True)]
    zoned = {one.tzinfo is not None for one in found}
    if len(zoned) == 2:
        row = next(row for row, one in enumerate(found) if one.tzinfo is None)
        raise BadInput(
            f"found {texts[row]!r} without a time zone, where others have one", place=places[row],
            remedy="State the zone everywhere, or nowhere",
        )  # fmt: skip
    return list(found), "" if True in zoned else "times state no zone: all are of one"


def _number_of_time(table: ForeignTable, row: int, at: int) -> float:
    """A number; raises BadInput that names the form where it is a date or a time of day."""
    try:
        return table.number(row, at)
    except BadInput as error:
        form = form_of([table.text(row, at)])
        if form is None:
            raise
        raise BadInput(
            error.what, place=error.place, remedy=f'Write form = "{form}" under [time] of the map'
        ) from None


def _moment(text: str, form: str, place: str) -> datetime:
    try:
        if form == "iso":
            return datetime.fromisoformat(text.replace(",", "."))
        return datetime.strptime(text, form)
    except ValueError:
        wanted = "ISO 8601, as 2024-05-31T14:05:06.5" if form == "iso" else f"a time as {form}"
        other = form_of([text])
        wanted += f'; or write form = "{other}" under [time] of the map' if other else ""
        raise BadInput(f"found {text!r}", place=place, remedy=f"Expected {wanted}") from None


def _clock(texts: Sequence[str], places: Sequence[str]) -> tuple[list[float | datetime], str]:
    """Times of the day; one that goes back by more than half a day is of the next day."""
    found: list[float | datetime] = []
    days, last = 0, -math.inf
    for text, place in zip(texts, places, strict=True):
        match = _CLOCK.fullmatch(text)
        if match is None:
            raise BadInput(f"found {text!r}", place=place, remedy="Expected a time as 14:05:06.5")
        hours, minutes = int(match[1]), int(match[2])
        seconds = float((match[3] or "0").replace(",", "."))
        if match[4]:
            hours = hours % 12 + (12 if match[4].lower() == "pm" else 0)
        if hours > 23 or minutes > 59 or seconds >= 61.0:
            raise BadInput(f"found {text!r}", place=place, remedy="There is no such time of day")
        value = days * DAY_S + hours * 3600.0 + minutes * 60.0 + seconds
        if value < last - 0.5 * DAY_S:
            days, value = days + 1, value + DAY_S
        found.append(value)
        last = value
    return found, f"clock times pass midnight {days} times" if days else ""


def seconds_from_start(moments: Sequence[float | datetime]) -> list[float]:
    """Seconds from the earliest moment."""
    first = min(moments)
    return [_apart(one, first) for one in moments]


def _apart(one: float | datetime, first: float | datetime) -> float:
    if isinstance(one, datetime) and isinstance(first, datetime):
        return (one - first) / timedelta(seconds=1)
    if isinstance(one, float) and isinstance(first, float):
        return one - first
    raise TypeError("times of two kinds")


def positions(reader: Reader, reading: Reading, sigma: Sigma) -> tuple[Array, Array]:
    """Positions (3, N) and covariances (3, 3, N), mm; nan where the row holds no reading.

    A spherical reading's covariance is that of its angles and its distance, turned.
    """
    if reading.kind == "xyz":
        position = reader.numbers(reading.numbers)
        return position, _covariance(reader, sigma, position)
    values = reader.numbers(reading.numbers)
    count = values.shape[1]
    radius = values[2] if reading.distance_mm is None else np.full(count, reading.distance_mm)
    turn = values[0] * (1.0 if reading.horizontal == "counter-clockwise" else -1.0)
    rise = values[1] if reading.vertical == "elevation" else 0.5 * np.pi - values[1]
    along = np.array([np.cos(rise) * np.cos(turn), np.cos(rise) * np.sin(turn), np.sin(rise)])
    aside = np.array([-np.sin(turn), np.cos(turn), np.zeros(count)])
    up = np.cross(along, aside, axis=0)
    assert sigma.angle is not None
    assert sigma.distance is not None
    across = (radius * sigma.angle) ** 2
    deep = (sigma.distance + sigma.per_distance * radius) ** 2
    covariance = (
        across * (_outer(aside) + _outer(up)) + deep * _outer(along)
    ) / sigma.coverage**2  # fmt: skip
    return radius * along, covariance


def angles(reader: Reader, reading: Reading, sigma: Sigma) -> dict[str, Array]:
    """Columns (N,) of a reading of azimuth and elevation, rad; nan where the row holds none."""
    values = reader.numbers(reading.numbers)
    turn = values[0] * (1.0 if reading.horizontal == "counter-clockwise" else -1.0)
    rise = values[1] if reading.vertical == "elevation" else 0.5 * np.pi - values[1]
    assert sigma.angle is not None
    spread = np.full(values.shape[1], sigma.angle / sigma.coverage)
    wide = spread / np.maximum(np.cos(rise), 1e-6) if sigma.sky else spread
    return {"azimuth": turn, "elevation": rise, "sazimuth": wide, "selevation": spread}


def one_number(reader: Reader, reading: Reading, sigma: Sigma) -> dict[str, Array]:
    """Columns (N,) of a reading of one number, mm or rad; nan where the row holds none."""
    if reading.value is None:
        value = reader.numbers(reading.numbers)[0]
    else:
        value = np.full(len(reader.table.rows), reading.value)
    spread = np.full(value.size, sigma.value or np.nan)
    if sigma.numbers is not None:
        spread = reader.numbers(sigma.numbers)[0]
        _uncertain(reader, sigma.numbers, spread[None], np.isfinite(value))
    names = ("z", "sz") if reading.kind == "height" else ("value", "sigma")
    return dict(zip(names, (value, spread / sigma.coverage), strict=True))


def _uncertain(reader: Reader, numbers: Numbers, each: Array, there: BoolArray) -> None:
    """Refuse uncertainties (k, N) that are none where a reading is ``there`` (N,)."""
    wrong = np.argwhere((there & ~(each > 0.0)).T)
    if wrong.size:
        row, column = (int(one) for one in wrong[0])
        found = each[column, row]
        raise BadInput(
            "the uncertainty is missing" if np.isnan(found) else f"an uncertainty of {found:g}",
            place=reader.table.place(row, reader.at(numbers.columns[column], numbers.place)),
            remedy='Write one larger than zero, or [sigma] value = "..." for all readings',
        )


def _outer(v: Array) -> Array:
    return np.asarray(v[:, None] * v[None, :])


def _covariance(reader: Reader, sigma: Sigma, position: Array) -> Array:
    if sigma.numbers is not None:
        each = reader.numbers(sigma.numbers)
        _uncertain(reader, sigma.numbers, each, np.asarray(np.isfinite(position).all(axis=0)))
        each = each / sigma.coverage
    else:
        assert sigma.value is not None
        distance = np.linalg.norm(position, axis=0)
        each = np.tile((sigma.value + sigma.per_distance * distance) / sigma.coverage, (3, 1))
    return np.asarray(np.einsum("in,ij->ijn", each**2, np.eye(3)))
