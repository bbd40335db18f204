"""What is wrong with a mock machine beyond its parameters: a flat table of named numbers."""

import re
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

from mocks.hidden import effects
from mocks.hidden.effect import LIMB, HiddenEffect, Physics
from mocks.physics.circumstances import Stroke
from mocks.physics.pose import Array
from mocks.physics.table_file import numbers_by_name, read_table


class Hidden:
    """A table of hidden effects.

    Parameters
    ----------
    table : mapping
        Names and numbers, nested or dotted; raises ValueError for a name that is not known.
    """

    def __init__(self, table: Mapping[str, object] | None = None) -> None:
        self.values: dict[str, float] = numbers_by_name(table or {}, "hidden effect")
        for name in self.values:
            if _effect_of(name) is None:
                raise ValueError(
                    f'the mock knows no hidden effect "{name[:80]}"; '
                    "names are those of the catalogue's parameters, or begin with unknown"
                )

    @classmethod
    def read(cls, path: Path) -> "Hidden":
        """Read a TOML or JSON file with a table ``hidden`` (or nothing but the table)."""
        table = read_table(path)
        hidden = table.get("hidden", table)
        if not isinstance(hidden, Mapping):
            raise ValueError(f"{path}: hidden must be a table of names and numbers")
        try:
            return cls(hidden)
        except ValueError as error:
            raise ValueError(f"{path}: {error}") from error

    @property
    def effects(self) -> tuple[HiddenEffect, ...]:
        """The effects of which any number is given."""
        return tuple(effect for effect in effects() if self.has(f"{effect.id}."))

    def physics(self, limbs: tuple[str, ...], stroke: Stroke) -> list[Physics]:
        """What they add on any machine."""
        return [effect.physics(self, limbs, stroke) for effect in self.effects]

    def get(self, name: str, default: float = 0.0) -> float:
        """One number; ``default`` where it is not given."""
        return self.values.get(name, default)

    def limbs(self, pattern: str, limbs: tuple[str, ...]) -> Array:
        """One number for each limb: ``pattern`` with ``*`` for its name, (n,)."""
        return np.array([self.get(pattern.replace("*", limb)) for limb in limbs])

    def check(self, machine: str, limbs: tuple[str, ...]) -> None:
        """Raise ValueError for what this machine does not have."""
        for name in self.values:
            limb, effect = re.search(LIMB, name), _effect_of(name)
            absent = effect is not None and not effect.of(machine)
            if absent or (limb is not None and limb.group() not in limbs):
                raise ValueError(f'the mock {machine} has no hidden effect "{name}"')

    def vector(self, stem: str, names: str = "x y z") -> Array:
        """Numbers ``stem.x``, ``stem.y``, ..., (len(names),)."""
        return np.array([self.get(f"{stem}.{name}") for name in names.split()])

    def has(self, prefix: str) -> bool:
        """Whether any number of this effect is given."""
        return any(name.startswith(prefix) for name in self.values)


@cache
def _effect_of(name: str) -> HiddenEffect | None:
    """The effect to which a number belongs; None if there is no such number."""
    for effect in effects():
        if re.fullmatch(rf"{re.escape(effect.id)}\.({effect.numbers})", name):
            return effect
    return None
