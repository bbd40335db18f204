"""What is sent makes of the lines that stand there the lines that should; equal cells stay."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from rich.segment import Segment
from rich.style import Style
from textual.strip import Strip

from app.tui.difference import Cell, cells, changes

WIDTH = 24
STYLES = (None, Style(bold=True), Style(color="red"))
CHARACTERS = st.sampled_from("ab \u2588\u28ff\u96ea")  # one of them is two cells wide


@st.composite
def lines(draw: st.DrawFn) -> list[Strip]:
    """A few lines of one width, in a few styles."""
    return [draw(line()) for _ in range(draw(st.integers(1, 4)))]


@st.composite
def line(draw: st.DrawFn) -> Strip:
    segments = [
        Segment(text, style)
        for text, style in draw(
            st.lists(
                st.tuples(st.text(CHARACTERS, min_size=1, max_size=9), st.sampled_from(STYLES)),
                max_size=5,
            )
        )
    ]
    return Strip(segments).adjust_cell_length(WIDTH)


def after(shown: list[Strip], wanted: list[Strip]) -> list[list[Cell]]:
    """What a terminal shows that stood at ``shown`` and was sent the changes."""
    screen = [cells(line) for line in shown] + [[] for _ in wanted[len(shown) :]]
    for x, y, strip in changes(shown, wanted):
        new = cells(strip)
        screen[y][x : x + len(new)] = new
    return screen[: len(wanted)]


@pytest.mark.long
@given(lines(), lines())
def test_the_changes_make_the_wanted_lines(shown: list[Strip], wanted: list[Strip]) -> None:
    assert after(shown, wanted) == [cells(line) for line in wanted]


@pytest.mark.long
@given(lines())
def test_nothing_is_sent_for_what_stands_there(shown: list[Strip]) -> None:
    assert list(changes(shown, shown)) == []


@given(line(), line())
def test_no_character_of_two_cells_is_cut(before: Strip, now: Strip) -> None:
    edges = [0]
    for character, _ in cells(now):
        edges.append(edges[-1] + 1)
        if not character:
            edges.remove(edges[-2])
    for x, _, strip in changes([before], [now]):
        assert {x, x + strip.cell_length} <= set(edges)


def test_one_cell_is_sent_for_one_that_changed() -> None:
    before, now = (Strip([Segment(f"{text:<80}")]) for text in ("12:00:01", "12:00:02"))
    assert [(x, y, strip.text) for x, y, strip in changes([before], [now])] == [(7, 0, "2")]
