"""Tables whose columns are as wide as what they hold, and never take room from one another.

Textual works out the width of a column when it is idle, from what it has drawn by then: after a
change of the terminal's size that may be a column of two signs. Here every width is given.
"""

from collections.abc import Sequence

from rich.text import Text
from textual.widgets import DataTable

Cell = Text | str


def fill(
    table: DataTable[Text],
    heads: Sequence[str],
    rows: Sequence[Sequence[Cell]],
    *,
    keys: Sequence[str] = (),
    left: Sequence[int] = (0,),
    most: int = 40,
    gap: int = 2,
) -> None:
    """Put rows into a table, the cursor where it was.

    Parameters
    ----------
    heads : sequence of str
        Names of the columns.
    rows : sequence of sequences of Text or str
        Cells; texts keep their style.
    keys : sequence of str
        A key for each row, if they are to be asked for.
    left : sequence of int
        Columns that stand at the left; all others hold numbers and stand at the right.
    most : int
        Signs of the widest column.
    gap : int
        Signs between two columns.
    """
    table.cell_padding = 0
    line = table.cursor_row
    table.clear(columns=True)
    styled = [[cell if isinstance(cell, Text) else Text(cell) for cell in row] for row in rows]
    for number, head in enumerate(heads):
        apart = " " * gap if number else ""
        column = [Text(head), *(row[number] for row in styled)]
        for cell in column:
            cell.justify = "left" if number in left else "right"
            cell.truncate(most, overflow="ellipsis")
            cell.pad_left(len(apart))
        table.add_column(column[0], width=max(cell.cell_len for cell in column))
    for number, row in enumerate(styled):
        table.add_row(*row, key=keys[number] if keys else None)
    table.move_cursor(row=min(line, max(0, len(rows) - 1)))
