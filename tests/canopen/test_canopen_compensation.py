"""What the controller corrects: the laws of pitch, lost motion and cyclic table."""

import math
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from drivers.canopen.eds import dictionary, eds_path
from mocks.canopen.compensation import Compensation, direction_of
from mocks.canopen.parameters import ParameterSet, acceptable

SINE = [0.005 * math.sin(2 * math.pi * k / 32) for k in range(32)]
extensions = st.floats(-36.0, 36.0)
compensations = st.builds(
    Compensation,
    st.floats(-1e-3, 1e-3),
    st.floats(0.0, 0.05),
    st.sampled_from([0.0, 2.0, 5.0]),
    st.just(SINE),
)


@given(compensations, extensions, st.sampled_from([-1, 0, 1]))
def test_compensated_drive_gives_the_wanted_extension(
    compensation: Compensation, wanted: float, direction: int
):
    drive = compensation.drive_for(wanted, direction)
    assert compensation.wanted_for(drive, direction) == pytest.approx(wanted, abs=1e-9)


@given(extensions, st.integers(-5, 5))
def test_table_repeats_with_its_period(extension: float, turns: int):
    compensation = Compensation(0.0, 0.0, 2.0, SINE)
    assert compensation.cyclic(extension + 2.0 * turns) == pytest.approx(
        compensation.cyclic(extension), abs=1e-12
    )


def test_table_holds_at_its_points_and_is_linear_between():
    compensation = Compensation(0.0, 0.0, 3.2, SINE)
    assert [compensation.cyclic(0.1 * k) for k in range(32)] == pytest.approx(SINE, abs=1e-14)
    assert compensation.cyclic(0.05) == pytest.approx(SINE[1] / 2)
    assert compensation.cyclic(-0.05) == pytest.approx(SINE[31] / 2)


def test_no_period_no_cyclic_error():
    assert Compensation(0.0, 0.0, 0.0, SINE).cyclic(0.3) == 0.0


def test_direction_is_the_sign_of_the_last_change_that_was_one():
    direction, seen = 0, []
    for change in (0.0, 5e-5, 1.0, -5e-5, -0.2, 1e-4, 2e-4):
        direction = direction_of(change, direction, 1e-4)
        seen.append(direction)
    assert seen == [0, 0, 1, 1, -1, -1, 1]


@pytest.mark.parametrize(
    ("name", "value", "good"),
    [
        ("leg1.L0", 235.0, True),
        ("leg1.L0", 245.0, False),
        ("leg1.L0", math.nan, False),
        ("screw-pitch.leg1", 0.06, False),
        ("screw-pitch.leg1", -0.04, True),
        ("backlash.leg1", -0.01, False),
        ("backlash.leg1", 0.02, True),
        ("screw-cyclic-table.leg1.period", 0.005, False),
        ("screw-cyclic-table.leg1.period", 0.0, True),
        ("screw-cyclic-table.leg1.5", 2.0, False),
    ],
)
def test_values_are_accepted_within_reason(name: str, value: float, good: bool):
    assert acceptable(name, value, 230.715) is good


def parameters(nvm: Path) -> ParameterSet:
    return ParameterSet(dictionary(eds_path("hexapod_controller"), 10), nvm)


def test_stored_set_survives_in_its_file(tmp_path: Path):
    first = parameters(tmp_path / "nvm")
    first.active["leg2.P_z"] = 0.1 + 0.2
    first.store()
    second = parameters(tmp_path / "nvm")
    assert second.boot()
    assert second.active == first.active
    assert second.checksum() == first.checksum()


@pytest.mark.parametrize("text", ["", "{}", '{"format": "pkmcal-nvm/1", "crc32": 1, "values": []}'])
def test_damaged_file_gives_the_defaults(tmp_path: Path, text: str):
    (tmp_path / "nvm").write_text(text)
    damaged = parameters(tmp_path / "nvm")
    assert not damaged.boot()
    assert damaged.active == damaged.defaults
