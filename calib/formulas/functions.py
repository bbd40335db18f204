"""What a formula may call, and what it may name beside its unknowns and the run's columns."""

import math
from collections.abc import Callable

import numpy as np

from calib.arrays import Array

CONSTANTS = {"pi": math.pi, "e": math.e}

FUNCTIONS: dict[str, tuple[Callable[[Array], Array], Callable[[Array], Array]]] = {
    "sin": (np.sin, np.cos),
    "cos": (np.cos, lambda x: -np.sin(x)),
    "tan": (np.tan, lambda x: 1.0 / np.cos(x) ** 2),
    "asin": (np.arcsin, lambda x: 1.0 / np.sqrt(1.0 - x**2)),
    "acos": (np.arccos, lambda x: -1.0 / np.sqrt(1.0 - x**2)),
    "atan": (np.arctan, lambda x: 1.0 / (1.0 + x**2)),
    "sinh": (np.sinh, np.cosh),
    "cosh": (np.cosh, np.sinh),
    "tanh": (np.tanh, lambda x: 1.0 - np.tanh(x) ** 2),
    "exp": (np.exp, np.exp),
    "log": (np.log, lambda x: 1.0 / x),
    "sqrt": (np.sqrt, lambda x: 0.5 / np.sqrt(x)),
    "abs": (np.abs, np.sign),
    "sign": (np.sign, np.zeros_like),
    "step": (lambda x: np.heaviside(x, 1.0), np.zeros_like),
}
"""Each function of one argument with its derivative."""


SEVERAL: dict[str, tuple[int, int]] = {"where": (3, 3), "max": (2, 8), "min": (2, 8)}
"""Functions of several arguments: fewest and most."""

LABELS = ("nest", "pose")
"""``nest("3")`` is 1 at readings of that nest, and 0 else."""

OWN = ("s", "q", "l", "direction", "step", "force", "way", "since")
"""Names of each actuator's own state; ``s4`` and ``s[leg4]`` are those of a particular one."""
POSE = tuple(f"pose_{name}" for name in ("x", "y", "z", "rx", "ry", "rz"))
"""Commanded pose of the platform in the base frame, mm and rad."""
POINT = ("x", "y", "z", "range", "azimuth", "elevation")
"""Names of the point that is read."""
