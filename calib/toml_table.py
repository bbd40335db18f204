"""Typed reading of a TOML text: whatever is missing or wrong is named with file, line, key, remedy.

Every reader of a TOML format asks a :class:`TomlTable` for its keys. What was asked is kept, so
that a reference page can be checked against the code that reads the format.
"""

import difflib
import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from calib.errors import BadInput
from calib.plain_text import plain
from calib.quantity import LARGEST, in_short, is_meant, quantity
from calib.toml_faults import Faults, some_number, some_numbers, standing_in
from calib.toml_place import joined_names, keys_of, line_of, load_toml

ANY_NAME = "NAME"
"""Stands in the paths of asked keys for a name that the writer of a file chooses."""


@dataclass(frozen=True)
class Asked:
    """What a reader asked of one key.

    ``kind`` in words ("number", "text", "3 numbers"), ``unit`` of a number, ``default`` what it
    is where it is left out (None: it must be there, or nothing is assumed instead of it).
    """

    kind: str
    unit: str
    required: bool
    default: object


class TomlTable:
    """One table of a TOML text, read key by key.

    :meth:`only` and :meth:`end` refuse keys that mean nothing; without them other keys are left
    alone. ``asked`` holds every key that was asked of the text so far, by its dotted name.
    """

    def __init__(
        self,
        data: Mapping[str, Any],
        text: str,
        source: str,
        path: tuple[str | int, ...] = (),
        shown: tuple[str, ...] = (),
        asked: dict[str, Asked] | None = None,
        named: bool = False,
        faults: Faults | None = None,
        missing: BadInput | None = None,
    ) -> None:
        self._data = data
        self._text = text
        self._source = source
        self._path = path
        self._shown = shown
        self._named = named
        self._mine: set[str] = set()
        self._missing = missing
        self.faults = faults
        self.asked: dict[str, Asked] = {} if asked is None else asked

    @classmethod
    def parse(cls, text: str, source: str, *, all_faults: bool = False) -> "TomlTable":
        """The whole of a text; BadInput with its line where it is not valid TOML.

        With ``all_faults`` reading goes on behind a fault, and who reads ends with
        ``faults.end()``.
        """
        text = plain(text)
        faults = Faults(source) if all_faults else None
        return cls(load_toml(text, source), text, source, faults=faults)

    def place(self, *keys: str | int) -> str:
        """File, line and key."""
        path = (*self._path, *keys)
        name = f", {path[-1]}" if path else ""
        return f"{self._source}, line {line_of(self._text, *path)}{name}"

    def wrong(self, what: str, *keys: str | int, remedy: str = "") -> BadInput:
        """What to raise for a fault at ``keys`` of this table."""
        return BadInput(what, place=self.place(*keys), remedy=remedy)

    def complain(self, what: str, *keys: str | int, remedy: str = "") -> None:
        """Raise a fault, or keep it where all are kept and go on."""
        fault = self.wrong(what, *keys, remedy=remedy)
        if self.faults is None:
            raise fault
        self.faults.add(fault)

    def only(self, *known: str) -> None:
        """Refuse keys other than ``known``."""
        for key in self._data:
            if key not in known:
                near = difflib.get_close_matches(key, known, 1)
                hint = f'Did you mean "{near[0]}"?' if near else f"Known: {', '.join(known)}"
                self.complain(f'unknown key "{key}"', key, remedy=hint)

    def end(self) -> None:
        """Refuse keys that nobody asked for: most likely a typing error."""
        self.only(*sorted(self._mine))

    @property
    def path(self) -> str:
        """Dotted name of this table; empty for the whole text."""
        return ".".join(map(str, self._path))

    def has(self, key: str) -> bool:
        """Whether the key is there."""
        return key in self._data

    def __iter__(self) -> Iterator[str]:
        return iter(self._data)

    def names(self) -> list[str]:
        """Every key, in the order of the file."""
        return list(self._data)

    def as_it_stands(self) -> dict[str, Any]:
        """The whole table as TOML has it; nothing in it is asked for."""
        return dict(self._data)

    def raw(self, key: str, kind: str = "any", *, required: bool = False) -> Any:
        """A value as it stands; None where it is missing."""
        return self._get(key, Asked(kind, "", required, None), f"{key} = ...")

    def format(self, *known: str) -> str:
        """Check the key ``format``, with which every file begins."""
        remedy = f'Write format = "{known[0]}"'
        if "format" not in self._data:
            raise self.wrong("format is missing", "format", remedy=f"{remedy} first")
        value = self._get("format", Asked("text", "", True, None))
        if value not in known:
            raise self.wrong(f"format is {in_short(value)}", "format", remedy=remedy)
        return str(value)

    def table(self, key: str, *, required: bool = True) -> "TomlTable":
        """Read a table inside this one; an empty one where it may be missing."""
        return self._inside(key, required, named=False)

    def named(self, key: str, *, required: bool = True) -> "TomlTable":
        """Read a table whose keys are names that the writer of the file chooses."""
        return self._inside(key, required, named=True)

    def tables(self, key: str) -> Iterator["TomlTable"]:
        """Read an array of tables ``[[key]]``; none where it is missing."""
        value = self._get(key, Asked("tables", "", False, None))
        if value is not None and not (
            isinstance(value, list) and all(isinstance(entry, Mapping) for entry in value)
        ):
            raise self.wrong(f"{key} is no list of tables", key, remedy=f"Write [[{key}]]")
        for index, entry in enumerate(value or ()):
            path, shown = (*self._path, key, index), self._shown_at(key)
            yield TomlTable(
                entry, self._text, self._source, path, shown, self.asked, faults=self.faults
            )

    def _inside(self, key: str, required: bool, named: bool) -> "TomlTable":
        missing: BadInput | None = None
        value: Any = {}
        try:
            value = self._get(key, Asked("table", "", required, None), f"[{key}]")
            value = {} if value is None else value
            if not isinstance(value, Mapping):
                raise self.wrong(
                    f"{key} is {in_short(value)}, not a table", key, remedy=f"Write [{key}]"
                )
        except BadInput as fault:
            if self.faults is None:
                raise
            self.faults.add(fault)
            missing, value = fault, {}
        path, shown = (*self._path, key), self._shown_at(key)
        return TomlTable(
            value, self._text, self._source, path, shown, self.asked, named, self.faults, missing
        )

    @standing_in(lambda key, default=None: default or "")
    def text(self, key: str, default: str | None = None) -> str:
        """Read a string."""
        value = self._get(key, Asked("text", "", default is None, default), f'{key} = "..."')
        if value is None:
            return default or ""
        if not isinstance(value, str):
            raise self.wrong(
                f"{key} is {in_short(value)}, not text", key, remedy='Write it in "quotes"'
            )
        return value

    def choice(self, key: str, choices: Collection[str], default: str | None = None) -> str:
        """Read one of some words."""
        value = self.text(key, default)
        self.note(key, Asked(" or ".join(choices), "", default is None, default))
        if self._missing is not None and default is None:
            raise self._missing
        if value not in choices:
            remedy = f"Expected {_either(choices)}"
            if default is None:
                raise self.wrong(f"{key} is {in_short(value)}", key, remedy=remedy)
            self.complain(f"{key} is {in_short(value)}", key, remedy=remedy)
            return default
        return value

    @standing_in(lambda key: [])
    def texts(self, key: str) -> list[str]:
        """Read a list of strings; empty where it is missing."""
        value = self._get(key, Asked("list of texts", "", False, None))
        if value is None:
            return []
        if not isinstance(value, list) or not all(isinstance(one, str) for one in value):
            raise self.wrong(f"{key} is {in_short(value)}", key, remedy='Write ["...", "..."]')
        return list(value)

    @standing_in(lambda key, default: default)
    def flag(self, key: str, default: bool) -> bool:
        """Read true or false."""
        value = self._get(key, Asked("true or false", "", False, default))
        if value is None:
            return default
        if not isinstance(value, bool):
            raise self.wrong(f"{key} is {in_short(value)}", key, remedy="Write true or false")
        return value

    @standing_in(some_number)
    def number(
        self,
        key: str,
        default: float | None = None,
        *,
        unit: str = "",
        above: float | None = None,
        least: float = -LARGEST,
        most: float = LARGEST,
    ) -> float:
        """Read a number greater than ``above`` and within ``least`` .. ``most``."""
        value = self._get(key, Asked("number", unit, default is None, default), f"{key} = ...")
        if value is None:
            return float(default or 0.0)
        if not _is_number(value):
            remedy = f"Write a number{f' in {unit}' if unit else ''}"
            raise self.wrong(f"{key} is {in_short(value)}, not a number", key, remedy=remedy)
        if above is not None and value <= above:
            raise self.wrong(
                f"{key} is {in_short(value)}", key, remedy=f"It must be greater than {above:g}"
            )
        return float(self._within(key, value, least, most))

    def optional_number(
        self, key: str, *, unit: str = "", above: float | None = None, finite: bool = True
    ) -> float | None:
        """Read a number that may be left out without another taking its place."""
        value = self._get(key, Asked("number", unit, False, None))
        if value is None:
            return None
        if not finite and _is_nan(value):
            return math.nan
        value = self.number(key, unit=unit, above=above)
        self.note(key, Asked("number", unit, False, None))
        return value

    @standing_in(lambda key, default=None, *, least=0, most=None: default or least)
    def whole(
        self, key: str, default: int | None = None, *, least: int = 0, most: int | None = None
    ) -> int:
        """Read a whole number within ``least`` .. ``most``."""
        asked = Asked("whole number", "", default is None, default)
        value = self._get(key, asked, f"{key} = {least}")
        if value is None:
            return default or 0
        whole = isinstance(value, int) and not isinstance(value, bool)
        if not whole or value < least or value > (LARGEST if most is None else most):
            upper = "" if most is None else f" and at most {most}"
            remedy = f"Write a whole number, at least {least}{upper}"
            raise self.wrong(f"{key} is {in_short(value)}", key, remedy=remedy)
        return int(value)

    @standing_in(some_numbers)
    def numbers(
        self,
        key: str,
        length: int,
        default: tuple[float, ...] | None = None,
        *,
        unit: str = "",
        most: float = LARGEST,
        finite: bool = True,
    ) -> tuple[float, ...]:
        """Read a list of ``length`` numbers, none beyond ``most`` in either direction."""
        asked = Asked(f"{length} numbers", unit, default is None, default)
        example = f"[{', '.join(['0.0'] * length)}]"
        value = self._get(key, asked, f"{key} = {example}")
        if value is None:
            return default or ()
        good = isinstance(value, list) and len(value) == length
        if not good or not all(
            (_is_number(one) and abs(one) <= most) or (not finite and _is_nan(one)) for one in value
        ):
            of = f" in {unit}" if unit else ""
            remedy = f"Write {length} finite numbers{of}, as {example}"
            raise self.wrong(f"{key} is {in_short(value)}", key, remedy=remedy)
        return tuple(float(one) for one in value)

    @standing_in(lambda key, unit, default=None, *, least=0.0, most=0.0: default or max(least, 0.0))
    def quantity(
        self,
        key: str,
        unit: str,
        default: float | None = None,
        *,
        least: float = -LARGEST,
        most: float = LARGEST,
    ) -> float:
        """Read a number in ``unit``, or a text that carries its own: ``"15 deg"``."""
        asked = Asked("number or text with a unit", unit, default is None, default)
        value = self._get(key, asked, f"{key} = ...")
        if value is None:
            return float(default or 0.0)
        return self._within(key, quantity(value, unit, self.place(key)), least, most)

    @standing_in(lambda key, length, unit, default=None, **bounds: default or (0.0,) * length)
    def quantities(
        self,
        key: str,
        length: int,
        unit: str,
        default: tuple[float, ...] | None = None,
        *,
        least: float = -LARGEST,
        most: float = LARGEST,
    ) -> tuple[float, ...]:
        """Read a list of ``length`` numbers in ``unit`` or texts that carry their own."""
        asked = Asked(f"{length} numbers or texts with a unit", unit, default is None, default)
        value = self._get(key, asked, f"{key} = [...]")
        if value is None:
            return default or ()
        if not isinstance(value, list) or len(value) != length:
            raise self.wrong(f"{key} is {in_short(value)}", key, remedy=f"Write {length} numbers")
        place = self.place(key)
        return tuple(self._within(key, quantity(one, unit, place), least, most) for one in value)

    def _within(self, key: str, value: float, least: float, most: float) -> float:
        if value < least:
            raise self.wrong(f"{key} is {in_short(value)}", key, remedy=_bound(least, "at least"))
        if value > most:
            raise self.wrong(f"{key} is {in_short(value)}", key, remedy=_bound(most, "at most"))
        return value

    def limits(self, key: str, unit: str) -> tuple[float, float]:
        """Read ``[low, high]`` in ``unit``, numbers or texts that carry their own."""
        low, high = self.quantities(key, 2, unit)
        if low >= high:
            raise self.wrong(
                f"the lower limit {low:g} is not below the upper {high:g}",
                key,
                remedy=f"Write {key} = [low, high]",
            )
        return low, high

    def numbers_by_name(self, key: str) -> dict[str, float]:
        """Read a table of numbers by name; ``leg1.L0 = 1.0`` without quotes is such a name too."""
        table = self.named(key, required=False)
        table.note("", Asked("number", "", False, None))
        found = joined_names(table._data)
        for name, value in found.items():
            if not _is_number(value) or not is_meant(value):
                raise table.wrong(
                    f"{name} is {in_short(value)}",
                    *keys_of(table._data, name),
                    remedy="Expected a finite number",
                )
        return {name: float(value) for name, value in found.items()}

    def numbers_here(self) -> dict[str, float]:
        """Every number of this table by its key; what is no number is left alone."""
        if self._named:
            self.note("", Asked("number", "", False, None))
        return {
            key: float(value)
            for key, value in self._data.items()
            if isinstance(value, float) or (isinstance(value, int) and is_meant(value))
        }

    def place_of_name(self, name: str) -> str:
        """Where a name of :meth:`numbers_by_name` stands, in a table read by :meth:`named`."""
        return self.place(*keys_of(self._data, name))

    def _shown_at(self, key: str) -> tuple[str, ...]:
        """The path of a key with NAME for what the writer of the file chose."""
        return (*self._shown, ANY_NAME if self._named else key)

    def note(self, key: str, asked: Asked) -> None:
        """Keep what is asked of a key, where a reader knows more of it than its reading tells."""
        self.asked[".".join(self._shown_at(key))] = asked
        self._mine.add(key)

    def _get(self, key: str, asked: Asked, example: str = "") -> Any:
        self.note(key, asked)
        if self._missing is not None and asked.required:
            raise self._missing
        if key not in self._data and asked.required:
            near = difflib.get_close_matches(key, [k for k in self._data if k not in self._mine], 1)
            found = f' (there is "{near[0]}")' if near else ""
            name = ".".join(map(str, (*self._path, key)))
            raise self.wrong(f"{name} is missing{found}", key, remedy=f"Add {example}")
        return self._data.get(key)


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and value == value


def _is_nan(value: object) -> bool:
    return isinstance(value, float) and math.isnan(value)


def _bound(bound: float, words: str) -> str:
    if not math.isfinite(bound):
        return "It must be a finite number"
    return f"It must be {words} {bound:g}"


def _either(choices: Collection[str]) -> str:
    if not choices:
        return "nothing: none is installed"
    *most, last = (f'"{choice}"' for choice in choices)
    return f"{', '.join(most)} or {last}" if most else last
