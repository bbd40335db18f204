"""What is wrong with a mock machine beyond its parameters: a flat table of named numbers.

Names of the catalogue are those of its parameters (``backlash.leg3``, ``thermal-growth.a``);
``parallelogram-sides.limb1`` is side 1 less side 2 in mm, ``joint-azimuth.limb1`` the platform
joint's less the slider's in rad, ``redundancy.limb`` the limb whose constraint is released, wholly
or by ``redundancy.share`` of its stiffness.
The names that begin with ``unknown.`` are the mock's own, outside the catalogue:

=================================  ===============================================================
``unknown.screw-quadratic.legN``   1/mm (1/rad): extension = k s^2
``unknown.hysteresis.legN``        mm (rad): extension with a memory of several past reversals
``unknown.bending.k``              mm/K: legs bend when structure and air differ, sunny side more
``unknown.soft-legs.k``            1/N: compliance that grows with extension, k s F
``unknown.platform-flex.k``        mm: nests sag within the platform when it tilts
``unknown.tide.amplitude``         mm, with ``unknown.tide.period`` s: floor heaves in a rhythm
``unknown.wobble.amplitude``       mm, with ``unknown.wobble.period`` deg: bearing error of the
                                   tracker's vertical axis
``unknown.two-face.hz``            rad: collimation error, of opposite sign in the two faces
=================================  ===============================================================

Bending and soft legs are the hexapod's alone; the others go with every machine.
"""

import json
import re
import tomllib
from collections.abc import Iterator, Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_LEG = r"(leg[1-6]|limb[1-3])"
_CATALOGUE = (
    r"gravity-sag\.c",
    r"thermal-growth\.a",
    rf"screw-pitch\.{_LEG}",
    rf"screw-cyclic\.{_LEG}\.(sin|cos)",
    r"screw-cyclic\.period",
    rf"backlash\.{_LEG}",
    r"screw-twist\.L",
    rf"joint-tilt\.{_LEG}\.(base|platform)\.(y|z)",
    r"settling\.(k|tau)",
    r"tracker-scale\.k",
    r"tracker-offset\.r0",
    r"tracker-drift\.([vw][xyz]|duration)",
    r"nest-offset\.[^.]+\.[xyz]",
    r"frame-shift\.(x|y|z|rx|ry|rz|t0|where)",
    rf"(parallelogram-sides|joint-azimuth)\.{_LEG}",
    r"redundancy\.(limb|share)",
)
_UNKNOWN = (
    rf"screw-quadratic\.{_LEG}",
    rf"hysteresis\.{_LEG}",
    r"bending\.k",
    r"soft-legs\.k",
    r"platform-flex\.k",
    r"(tide|wobble)\.(amplitude|period)",
    r"two-face\.hz",
)
_KNOWN = re.compile("|".join([*_CATALOGUE, *(rf"unknown\.{name}" for name in _UNKNOWN)]))


class Hidden:
    """A table of hidden effects.

    Parameters
    ----------
    table : mapping
        Names and numbers, nested or dotted; raises ValueError for a name that is not known.
    """

    def __init__(self, table: Mapping[str, object] | None = None) -> None:
        self.values: dict[str, float] = dict(_flat(table or {}))
        for name in self.values:
            if _KNOWN.fullmatch(name) is None:
                raise ValueError(
                    f'the mock knows no hidden effect "{name}"; '
                    "names are those of the catalogue's parameters, or begin with unknown."
                )

    @classmethod
    def read(cls, path: Path) -> "Hidden":
        """Read a TOML or JSON file with a table ``hidden`` (or nothing but the table)."""
        text = path.read_text(encoding="utf-8")
        table = json.loads(text) if path.suffix == ".json" else tomllib.loads(text)
        return cls(table.get("hidden", table))

    def get(self, name: str, default: float = 0.0) -> float:
        """One number; ``default`` where it is not given."""
        return self.values.get(name, default)

    def limbs(self, pattern: str, limbs: tuple[str, ...]) -> Array:
        """One number for each limb: ``pattern`` with ``*`` for its name, (n,)."""
        return np.array([self.get(pattern.replace("*", limb)) for limb in limbs])

    def check(self, machine: str, limbs: tuple[str, ...], absent: tuple[str, ...]) -> None:
        """Raise ValueError for what this machine does not have.

        ``absent``: beginnings of the names of effects that it cannot have.
        """
        for name in self.values:
            limb = re.search(_LEG, name)
            if (limb is not None and limb.group() not in limbs) or name.startswith(absent):
                raise ValueError(f'the mock {machine} has no hidden effect "{name}"')

    def vector(self, stem: str, names: str = "x y z") -> Array:
        """Numbers ``stem.x``, ``stem.y``, ..., (len(names),)."""
        return np.array([self.get(f"{stem}.{name}") for name in names.split()])

    def has(self, prefix: str) -> bool:
        """Whether any number of this effect is given."""
        return any(name.startswith(prefix) for name in self.values)


def _flat(table: Mapping[str, object], prefix: str = "") -> Iterator[tuple[str, float]]:
    for key, value in table.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{prefix}{key}.")
        elif isinstance(value, (int, float)) and not isinstance(value, bool):
            yield prefix + key, float(value)
        else:
            raise ValueError(f'hidden effect "{prefix}{key}" must be a number, got {value!r}')
