"""Small vectors at places, drawn in characters: where errors point in the workspace."""

from dataclasses import dataclass

import numpy as np

from app.show.braille import Canvas
from calib.arrays import Array

CELL = 8, 4
"""Columns and rows of characters in which vectors are drawn as their mean: what is alike there
stands out, what is noise falls with the number of readings."""
LENGTH = 6.0
"""Characters that a vector as large as most (95 %) is long."""


@dataclass(frozen=True)
class VectorMap:
    """A drawing, line by line; ``ten_signs`` is the size of a vector ten characters long."""

    lines: tuple[str, ...]
    ten_signs: float


def vector_map(places: Array, vectors: Array, columns: int, rows: int) -> VectorMap:
    """Draw the mean vector of each cell from the mean of its places, a square where it begins.

    Parameters
    ----------
    places : (2, N)
        Across and up, mm.
    vectors : (2, N)
        In any unit; ``ten_signs`` has the same.
    columns, rows : int
        Size of the drawing in characters.
    """
    if not places.size:
        return VectorMap(("",) * rows, 0.0)
    low, high = places.min(axis=1), places.max(axis=1)
    room = 0.08 * max(float(np.max(high - low)), 1e-9)
    canvas = Canvas(columns, rows, low - room, high + room)
    begin, vectors = _means(canvas, places, vectors)
    usual = float(np.quantile(np.linalg.norm(vectors, axis=0), 0.95))
    dots = 2.0 * LENGTH / usual if usual > 0.0 else 0.0
    for place, vector in zip(begin.T, vectors.T, strict=True):
        canvas.line(place, place + dots / canvas.scale * vector)
        for corner in ((0, 0), (1, 0), (0, 1), (1, 1)):
            canvas.dot(place * canvas.scale + canvas.origin + np.array(corner))
    return VectorMap(tuple(canvas.lines()), 20.0 / dots if dots else 0.0)


def _means(canvas: Canvas, places: Array, vectors: Array) -> tuple[Array, Array]:
    """Mean places and vectors (2, M) of the M cells that hold any."""
    size = np.array([2.0 * CELL[0], 4.0 * CELL[1]])
    at = np.floor((places.T * canvas.scale + canvas.origin) / size).astype(int)
    _, cell, count = np.unique(at, axis=0, return_inverse=True, return_counts=True)
    cell = cell.reshape(-1)
    both = np.array([[np.bincount(cell, row) / count for row in one] for one in (places, vectors)])
    return both[0], both[1]
