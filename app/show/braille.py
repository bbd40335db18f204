"""Line drawings in a terminal: every character is a grid of 2 x 4 dots."""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array

_SHADES = " .:-=+*##"
_DOTS = ((0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80))


class Canvas:
    """A canvas of ``columns`` x ``rows`` characters over a rectangle of the drawing.

    Equal lengths look equal: the rectangle is widened to the canvas's shape.
    """

    def __init__(self, columns: int, rows: int, low: Array, high: Array) -> None:
        self.dots = np.zeros((4 * rows, 2 * columns), dtype=bool)
        middle, span = 0.5 * (low + high), np.maximum(high - low, 1e-9)
        # A dot is as wide as it is high in most terminals.
        self.scale = min((2 * columns - 1) / span[0], (4 * rows - 1) / span[1])
        shape = np.array([2 * columns - 1, 4 * rows - 1])
        self.origin = 0.5 * shape - self.scale * np.array([middle[0], middle[1]])

    def line(self, a: Array, b: Array) -> None:
        """Draw from a (2,) to b (2,), x to the right and y up."""
        ends = np.array([a, b]) * self.scale + self.origin
        steps = int(np.max(np.abs(ends[1] - ends[0]))) + 2
        share = np.linspace(0.0, 1.0, steps)[:, None]
        columns, rows = np.rint(ends[0] + share * (ends[1] - ends[0])).astype(int).T
        rows = len(self.dots) - 1 - rows
        inside = (rows >= 0) & (rows < len(self.dots))
        inside &= (columns >= 0) & (columns < self.dots.shape[1])
        self.dots[rows[inside], columns[inside]] = True

    def mark(self, at: Array) -> None:
        """A small square around a point (2,)."""
        centre = np.asarray(at) * self.scale + self.origin
        for dx in (-1.0, 0.0, 1.0):
            for dy in (-1.0, 0.0, 1.0):
                self.dot(centre + np.array([dx, dy]))

    def dot(self, at: Array) -> None:
        """One dot, in dots from the lower left; outside of the canvas nothing happens."""
        column, row = round(float(at[0])), len(self.dots) - 1 - round(float(at[1]))
        if 0 <= row < len(self.dots) and 0 <= column < self.dots.shape[1]:
            self.dots[row, column] = True

    def lines(self) -> list[str]:
        """The drawing, a text line for each row of characters."""
        height, width = self.dots.shape
        blocks = self.dots.reshape(height // 4, 4, width // 2, 2)
        codes = 0x2800 + np.einsum("ridj,ij->rd", blocks, np.array(_DOTS))
        return ["".join(map(chr, row)) for row in codes]


def plain(text: str, encoding: str | None) -> str:
    """A drawing for a terminal or file that has no such characters: the more dots, the darker."""
    try:
        text.encode(encoding or "utf-8")
    except UnicodeEncodeError:
        return "".join(shade(character) for character in text)
    return text


def shade(character: str) -> str:
    """A sign of ASCII as dark as one of dots; any other as it is."""
    dots = ord(character) - 0x2800
    return _SHADES[dots.bit_count()] if 0 <= dots <= 0xFF else character


def beside(left: Sequence[str], right: Sequence[str], gap: str = "  ") -> str:
    """Two drawings side by side."""
    return "\n".join(f"{a}{gap}{b}".rstrip() for a, b in zip(left, right, strict=True))
