"""``run.toml``: which machine, where the nests are, what the controller held, what it carried."""

import math
import re
import tomllib
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from calib.errors import BadInput

FORMAT = "pkm-run/1"


@dataclass(frozen=True)
class Load:
    """What the machine carries.

    ``gravity`` (3,) in m/s^2, base frame; centres of mass (3,) in mm, platform frame. The mass of
    the payload is a channel (``payload_kg``), since it may change from reading to reading.
    """

    gravity: NDArray[np.float64]
    platform_mass_kg: float
    platform_com: NDArray[np.float64]
    payload_com: NDArray[np.float64]


@dataclass(frozen=True)
class Header:
    """Everything that ``run.toml`` says; nests as (3,) in mm (platform or base frame)."""

    machine: str
    title: str = ""
    tracker: Mapping[str, Any] = field(default_factory=dict)
    platform_nests: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    base_nests: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    controller_parameters: Mapping[str, float] = field(default_factory=dict)
    compensation: Mapping[str, float] = field(default_factory=dict)
    """What the controller compensated meanwhile, by its own names; missing is zero."""
    load: Load | None = None


def parse_header(
    text: str, *, source: str = "run.toml", parameters: Collection[str] | None = None
) -> Header:
    """Read ``run.toml``.

    Parameters
    ----------
    text : str
        The file's text.
    source : str
        The file's name, for messages.
    parameters : collection of str, optional
        The machine's parameter names; with them, names under ``[controller.parameters]`` are
        checked. Leave it out while the machine is not known yet.

    Raises
    ------
    BadInput
        With file, line and remedy, for broken TOML or a value that is not what it should be.
    """
    if not text.strip():
        raise BadInput(
            "the file is empty", place=source, remedy=f'It starts with format = "{FORMAT}"'
        )
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise _broken(error, text, source) from error
    reader = _Reader(table, text, source)
    reader.check_format()
    platform, base = reader.nests("platform"), reader.nests("base")
    if not platform:
        raise BadInput(
            "no nest is given under [nests.platform]",
            place=source,
            remedy="Write where each SMR nest is, mm in the platform frame: "
            '"3" = [0.0, 100.0, 0.0]',
        )
    for name in platform.keys() & base.keys():
        raise BadInput(
            f"nest {name!r} is both on the platform and on the base",
            place=reader.place(name),
            remedy="Give every nest a name of its own",
        )
    return Header(
        machine=reader.machine(),
        title=reader.title(),
        tracker=reader.table("tracker"),
        platform_nests=platform,
        base_nests=base,
        controller_parameters=reader.controller_parameters(parameters),
        compensation=reader.compensation(),
        load=reader.load(),
    )


def _broken(error: tomllib.TOMLDecodeError, text: str, source: str) -> BadInput:
    message = str(error)
    where = re.search(r"\(at line (\d+), column (\d+)\)", message)
    if where is not None:
        place = f"{source}, line {where[1]}, column {where[2]}"
        message = message[: where.start()].strip()
    else:
        place = f"{source}, line {len(text.splitlines())}"
        message = message.replace("(at end of document)", "at the end of the file").strip()
    return BadInput(f"not valid TOML: {message}", place=place, remedy="Correct this line")


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


class _Reader:
    """Reads typed values out of the parsed TOML and knows where they stand in the text."""

    def __init__(self, table: dict[str, Any], text: str, source: str) -> None:
        self._table = table
        self._lines = text.splitlines()
        self._source = source

    def place(self, key: str) -> str:
        pattern = re.compile(rf"""^\s*["']?{re.escape(key)}["']?\s*=""")
        header = re.compile(rf"""^\s*\[[^\]]*\b{re.escape(key)}["']?\s*\]""")
        for wanted in (pattern, header):
            for number, line in enumerate(self._lines, start=1):
                if wanted.match(line):
                    return f"{self._source}, line {number}, {key}"
        return f"{self._source}, {key}"

    def wrong(self, key: str, found: object, expected: str) -> BadInput:
        return BadInput(f"found {found!r}", place=self.place(key), remedy=f"Expected {expected}")

    def check_format(self) -> None:
        if "format" not in self._table:
            raise BadInput(
                "format is missing", place=self._source, remedy=f'Write format = "{FORMAT}" first'
            )
        if self._table["format"] != FORMAT:
            raise self.wrong("format", self._table["format"], f'"{FORMAT}"')

    def machine(self) -> str:
        if "machine" not in self._table:
            raise BadInput(
                "machine is missing",
                place=self._source,
                remedy='Write machine = "hexapod", or the path of a machine file',
            )
        name = self._table["machine"]
        if not isinstance(name, str) or not name.strip():
            raise self.wrong("machine", name, "the name of a machine or the path of its file")
        return name

    def title(self) -> str:
        title = self._table.get("title", "")
        if not isinstance(title, str):
            raise self.wrong("title", title, "a text")
        return title

    def table(self, name: str, inside: dict[str, Any] | None = None) -> dict[str, Any]:
        value = (self._table if inside is None else inside).get(name, {})
        if not isinstance(value, dict):
            raise self.wrong(name, value, f"a table [{name}]")
        return value

    def vector(self, key: str, value: object, unit: str) -> NDArray[np.float64]:
        if not isinstance(value, list) or len(value) != 3 or not all(map(_is_number, value)):
            raise self.wrong(key, value, f"three numbers in {unit}, as [0.0, 100.0, 0.0]")
        return np.array(value, dtype=np.float64)

    def nests(self, body: str) -> dict[str, NDArray[np.float64]]:
        table = self.table(body, self.table("nests"))
        return {name: self.vector(name, value, "mm") for name, value in table.items()}

    def compensation(self) -> dict[str, float]:
        """``[controller.compensation]``: numbers by name."""
        found = _flatten(self.table("compensation", self.table("controller")))
        for name, value in found.items():
            if not _is_number(value):
                raise self.wrong(name, value, "a finite number")
        return {name: float(value) for name, value in found.items()}

    def controller_parameters(self, known: Collection[str] | None) -> dict[str, float]:
        found = _flatten(self.table("parameters", self.table("controller")))
        for name, value in found.items():
            if not _is_number(value):
                raise self.wrong(name, value, "a finite number")
            if known is not None and name not in known:
                raise BadInput(
                    f"the machine has no parameter {name!r}",
                    place=self.place(name),
                    remedy=f"Expected one of {_some(known)}",
                )
        return {name: float(value) for name, value in found.items()}

    def load(self) -> Load | None:
        if "load" not in self._table:
            return None
        table = self.table("load")
        mass = table.get("platform_mass_kg", 0.0)
        if not _is_number(mass) or mass < 0:
            raise self.wrong("platform_mass_kg", mass, "a mass in kg, not negative")
        return Load(
            gravity=self.vector("gravity", table.get("gravity", [0.0, 0.0, -9.80665]), "m/s^2"),
            platform_mass_kg=float(mass),
            platform_com=self.vector("platform_com", table.get("platform_com", [0.0] * 3), "mm"),
            payload_com=self.vector("payload_com", table.get("payload_com", [0.0] * 3), "mm"),
        )


def _flatten(table: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Join dotted names: ``leg1.L0 = 1.0`` without quotes makes a nested table in TOML."""
    flat: dict[str, Any] = {}
    for key, value in table.items():
        name = f"{prefix}{key}"
        flat.update(_flatten(value, f"{name}.") if isinstance(value, dict) else {name: value})
    return flat


def _some(names: Collection[str], most: int = 4) -> str:
    listed = list(names)
    return ", ".join(listed[:most]) + (f" .. {listed[-1]}" if len(listed) > most else "")
