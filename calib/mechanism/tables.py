"""Reading tables of a machine file: what is wrong is said with its line."""

import difflib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from calib.errors import BadInput
from calib.quantity import quantity
from calib.toml_place import line_of


@dataclass
class TableReader:
    """A TOML text and its tables."""

    text: str
    source: str
    data: dict[str, Any]

    def place(self, *keys: str) -> str:
        """The file and the line where ``keys`` stand."""
        return f"{self.source}, line {line_of(self.text, *keys)}"

    def fail(self, what: str, *keys: str, remedy: str = "") -> BadInput:
        """What to raise for a fault at ``keys``."""
        return BadInput(what, place=self.place(*keys), remedy=remedy)

    def known(self, table: Mapping[str, Any], allowed: tuple[str, ...], *keys: str) -> None:
        """Refuse keys that mean nothing."""
        for key in table:
            if key not in allowed:
                near = difflib.get_close_matches(key, allowed, 1)
                hint = f'Did you mean "{near[0]}"?' if near else f"Known: {', '.join(allowed)}."
                raise self.fail(f'unknown key "{key}"', *keys, key, remedy=hint)

    def table(self, *keys: str) -> dict[str, Any]:
        """The table at ``keys``; empty if there is none."""
        node: Any = self.data
        for key in keys:
            node = node.get(key, {})
            if not isinstance(node, dict):
                raise self.fail(f'"{key}" must be a table', *keys)
        return dict(node)

    def text_of(self, table: Mapping[str, Any], key: str, *keys: str, default: str = "") -> str:
        """The text under ``key`` of a table that stands at ``keys``."""
        value = table.get(key, default)
        if not isinstance(value, str):
            raise self.fail(f'"{key}" must be text', *keys, key)
        return value

    def number(self, value: object, unit: str, *keys: str) -> float:
        """A number, or a text with a unit, in ``unit``."""
        return quantity(value, unit, self.place(*keys))

    def pair(self, value: object, unit: str, *keys: str) -> tuple[float, float]:
        """Limits [low, high]."""
        if not isinstance(value, list) or len(value) != 2:
            raise self.fail(f"{value!r} is not [low, high]", *keys)
        low, high = (self.number(v, unit, *keys) for v in value)
        if low >= high:
            raise self.fail(f"the lower limit {low:g} is not below the upper {high:g}", *keys)
        return low, high
