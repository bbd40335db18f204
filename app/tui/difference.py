"""What must be sent to a terminal so that it shows other lines: only the cells that changed."""

from collections.abc import Iterator, Sequence

from rich.cells import get_character_cell_size
from rich.style import Style
from textual.strip import Strip

Cell = tuple[str, Style | None]
NEAR = 8
"""Equal cells between two changes that are sent again rather than moved over."""


def changes(shown: Sequence[Strip], wanted: Sequence[Strip]) -> Iterator[tuple[int, int, Strip]]:
    """Yield what must be written: column, line and the cells from there on.

    Parameters
    ----------
    shown, wanted : sequence of Strip
        The lines that stand on the terminal, and those that should. Lines that are not in
        ``shown``, or are of another width there, are written whole.
    """
    for y, line in enumerate(wanted):
        if y >= len(shown) or shown[y].cell_length != line.cell_length:
            yield 0, y, line
        elif shown[y] != line:
            for start, end in spans(cells(shown[y]), cells(line)):
                yield start, y, line.crop(start, end)


def cells(line: Strip) -> list[Cell]:
    """Cells of a line; the second cell of a wide character is an empty one of its own."""
    found: list[Cell] = []
    for text, style, *_ in line:
        for character in text:
            size = get_character_cell_size(character)
            if size == 0 and found:  # combines with the one before
                found[-1] = (found[-1][0] + character, found[-1][1])
                continue
            found.append((character, style))
            found.extend([("", style)] * (size - 1))
    return found


def spans(before: Sequence[Cell], now: Sequence[Cell]) -> list[tuple[int, int]]:
    """First cell and end of each stretch that differs; stretches that are near are one.

    A stretch never begins in the middle of a wide character, nor ends there.
    """
    found: list[tuple[int, int]] = []
    for x, (old, new) in enumerate(zip(before, now, strict=False)):
        if old == new:
            continue
        if found and x - found[-1][1] < NEAR:
            found[-1] = (found[-1][0], x + 1)
        else:
            found.append((x, x + 1))
    return [_whole(start, end, before, now) for start, end in found]


def _whole(start: int, end: int, before: Sequence[Cell], now: Sequence[Cell]) -> tuple[int, int]:
    while start > 0 and (not now[start][0] or not before[start][0]):
        start -= 1
    while end < len(now) and (not now[end][0] or not before[end][0]):
        end += 1
    return start, end
