"""What the screens say of a gauge: its numbers as readings, its zero, its last line."""

import pytest

from app.session import events as ev
from app.tui.devices import gauge_text
from app.tui.measure import now_text
from app.tui.parts import StepLine
from app.tui.picture import Picture
from drivers.interface import GaugeState, Identity

TAKEN = ev.NumberTaken(1, "p01", "p1", "b2", (1.0,), 300.0123, 300.0, 0.002, "mm", 5.0)


@pytest.mark.parametrize("wide", [False, True])
def test_a_number_is_a_reading_with_its_distance_from_the_drawing(wide: bool) -> None:
    picture = Picture(steps=[StepLine("0001-touch", "read p1 to b2 at p01")])
    picture.tell(TAKEN)
    assert [(one.nest, round(one.miss_mm, 4)) for one in picture.points] == [("p1-b2", 0.0123)]
    said = now_text(picture, wide, ()).plain
    assert "p1 to b2: 300.0123 mm, off by 12.3 ± 2.0 µm" in said
    assert "zero: not looked at again yet" in said
    picture.tell(ev.DriftChecked(0.004, 0.05, 9.0))
    assert "zero moved 4.0/50 µm" in now_text(picture, wide, ()).plain


def test_an_angle_is_shown_in_degrees() -> None:
    picture = Picture(steps=[StepLine("0001-touch", "read place p01")])
    picture.tell(ev.NumberTaken(1, "p01", "p1", "", (1.0,), 0.1, 0.0999, 1e-5, "rad", 5.0))
    assert "p1: 5.7296 deg, off by 0.100 ± 0.010 mrad" in now_text(picture, True, ()).plain


def test_the_last_line_stands_on_devices() -> None:
    link = ev.Connected("gauge", Identity("lines"), "tcp:127.0.0.1:9")
    assert "not connected" in gauge_text(None, None).plain
    assert "✓ +0006.682 mm" in gauge_text(link, GaugeState(True, "+0006.682 mm")).plain
    assert "no reading" in gauge_text(link, GaugeState(False, "ERR 12")).plain
    assert "no answer" in gauge_text(link, None).plain
