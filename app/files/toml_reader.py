"""Typed reading of a TOML table: what is missing or wrong is named with file, line and remedy."""

from collections.abc import Mapping, Sequence
from pathlib import PurePath
from typing import Any

from calib.errors import BadInput
from calib.toml_place import line_of


class TableReader:
    """One table of a TOML file, read key by key; :meth:`end` refuses what nobody asked for."""

    def __init__(
        self, data: Mapping[str, Any], text: str, source: str, path: tuple[str, ...] = ()
    ) -> None:
        self._data = data
        self._text = text
        self._source = source
        self._path = path
        self._asked: set[str] = set()

    def wrong(self, key: str, what: str, remedy: str) -> BadInput:
        """An error at the place of ``key``."""
        line = line_of(self._text, *self._path, key)
        return BadInput(what, place=f"{PurePath(self._source)}, line {line}", remedy=remedy)

    def has(self, key: str) -> bool:
        """Whether the key is there."""
        return key in self._data

    def keys(self) -> list[str]:
        """Every key, in the order of the file."""
        return list(self._data)

    def _get(self, key: str, expected: str, required: bool) -> Any:
        self._asked.add(key)
        if key not in self._data and required:
            name = ".".join((*self._path, key))
            raise self.wrong(key, f'"{name}" is missing', f"Add {key} = {expected}")
        return self._data.get(key)

    def table(self, key: str, *, required: bool = True) -> "TableReader":
        """Read a table inside this one; an empty one where it may be missing."""
        value = self._get(key, "a table", required)
        if value is None:
            value = {}
        if not isinstance(value, Mapping):
            raise self.wrong(key, f'"{key}" is not a table', f"Write [{key}]")
        return TableReader(value, self._text, self._source, (*self._path, key))

    def text(self, key: str, default: str | None = None) -> str:
        """Read a string."""
        value = self._get(key, '"..."', default is None)
        if value is None:
            return default or ""
        if not isinstance(value, str):
            raise self.wrong(key, f'"{key}" is {value!r}, not text', 'Write it in "quotes"')
        return value

    def choice(self, key: str, choices: Sequence[str], default: str | None = None) -> str:
        """Read one of some words."""
        value = self.text(key, default)
        if value not in choices:
            raise self.wrong(key, f'"{key}" is "{value}"', f"Choose one of {', '.join(choices)}")
        return value

    def number(
        self,
        key: str,
        default: float | None = None,
        *,
        above: float | None = None,
        least: float | None = None,
    ) -> float:
        """Read a number, optionally greater than ``above`` or not less than ``least``."""
        value = self._get(key, "a number", default is None)
        if value is None:
            assert default is not None
            return default
        if isinstance(value, bool) or not isinstance(value, int | float) or value != value:
            raise self.wrong(key, f'"{key}" is {value!r}, not a number', "Write a number")
        if above is not None and value <= above:
            raise self.wrong(key, f'"{key}" is {value}', f"It must be greater than {above:g}")
        if least is not None and value < least:
            raise self.wrong(key, f'"{key}" is {value}', f"It must be at least {least:g}")
        return float(value)

    def whole(self, key: str, default: int | None = None, *, least: int = 0) -> int:
        """Read a whole number."""
        value = self._get(key, "a whole number", default is None)
        if value is None:
            assert default is not None
            return default
        if isinstance(value, bool) or not isinstance(value, int) or value < least:
            raise self.wrong(
                key, f'"{key}" is {value!r}', f"Write a whole number, at least {least}"
            )
        return value

    def flag(self, key: str, default: bool) -> bool:
        """Read true or false."""
        value = self._get(key, "true", False)
        if value is None:
            return default
        if not isinstance(value, bool):
            raise self.wrong(key, f'"{key}" is {value!r}', "Write true or false")
        return value

    def vector(
        self, key: str, length: int, default: tuple[float, ...] | None = None
    ) -> tuple[float, ...]:
        """Read a list of ``length`` numbers."""
        value = self._get(key, f"[{length} numbers]", default is None)
        if value is None:
            assert default is not None
            return default
        good = isinstance(value, list) and len(value) == length
        if not good or not all(
            isinstance(item, int | float) and not isinstance(item, bool) and abs(item) < 1e9
            for item in value
        ):
            raise self.wrong(key, f'"{key}" is {value!r}', f"Write {length} finite numbers")
        return tuple(float(item) for item in value)

    def end(self) -> None:
        """Refuse keys that nobody asked for: most likely a typing error."""
        for key in self._data:
            if key not in self._asked:
                known = ", ".join(sorted(self._asked))
                raise self.wrong(key, f'"{key}" is not known here', f"Known: {known}")
