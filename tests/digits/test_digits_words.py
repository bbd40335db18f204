"""Lengths, choices and moments as people read them."""

import pytest

from app.show.sizes import size_text
from calib.digits import length, turn
from calib.unknown import Choice, Moment, Unknown


@pytest.mark.parametrize(
    ("mm", "told"),
    [
        (0.0000123, "0.0123 um"),
        (0.114, "114 um"),
        (0.9994, "999 um"),
        (0.9997, "1 mm"),
        (4.5678, "4.57 mm"),
        (12345.6, "12346 mm"),
    ],
)
def test_a_length_has_the_unit_in_which_it_is_short(mm: float, told: str) -> None:
    assert length(mm) == told


@pytest.mark.parametrize(("rad", "told"), [(0.4, "400 mrad"), (9.28e-6, "9.28 urad")])
def test_so_has_an_angle(rad: float, told: str) -> None:
    assert turn(rad) == told


def test_a_choice_is_its_name_and_a_moment_says_in_which_run_it_is() -> None:
    where = Unknown("frame-shift.where", "1", means=Choice(((0.0, "the tool"), (1.0, "the base"))))
    entry = {"name": where.name, "value": 0.98, "sigma": 1e-6, "unit": where.unit}
    assert size_text(entry | where.in_words(0.98)) == "the base"
    t0 = Unknown("actuator-step.t0", "s", means=Moment((0.0, 896.0)))
    entry = {"name": t0.name, "value": 896.0, "sigma": 13.0, "unit": "s"}
    assert size_text(entry | t0.in_words(896.0)) == "896 +- 13 s (the start of run 2)"
    assert t0.in_words(1000.0) == {"means": "run 2 at 104 s"}
    assert t0.in_words(120.0) == {"means": "run 1 at 120 s"}
    assert Unknown("t0", "s", means=Moment((0.0,))).in_words(3.0) == {}
