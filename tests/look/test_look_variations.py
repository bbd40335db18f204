"""Variations of the kinds of mistakes: other columns and moments, several at once, put back."""

import zlib
from functools import lru_cache

import numpy as np
import pytest

from bench._first_look import clean
from bench.mistakes import WRONG, said_of
from bench.mistakes.clean import clean_run, machine_named
from bench.mistakes.variations import VARIATIONS
from calib.errors import BadInput
from calib.look.first import rows_alone
from calib.look.judged import settled
from calib.look.masses import in_other_unit
from calib.runs import parse_run
from calib.runs.record import Run

ORDERS = ("nest-by-nest", "pose-by-pose")
_COLUMNS = ("payload", "centre", "temperature", "air", "kelvin with", "x, ", "x is", "z is")
BY_ROWS = [
    name
    for name in VARIATIONS
    if name.startswith(_COLUMNS) or any(one in name for one in ("clock", "minutes", "fifteen"))
]
"""Those that the rows show by themselves."""
OTHERS = [name for name in VARIATIONS if name not in BY_ROWS]
NOT_ALONE = {
    "SMR larger in one nest, tracker moved",
    "q of the next row from the middle on",
    "a sister's file appended",
    "gravity along x",
    "tracker moved, nests exchanged",
}
"""Named among others on some machines; never in silence."""


@lru_cache(maxsize=12)
def made(machine: str, order: str) -> Run:
    return clean_run(machine, 11, poses=24, order=order)


def spoiled(name: str, machine: str, order: str) -> Run:
    mistake = VARIATIONS[name]
    hidden = mistake.hidden.get(machine)
    clean = (
        clean_run(machine, 11, poses=24, order=order, hidden=hidden)
        if hidden
        else made(machine, order)
    )
    return mistake.make(clean, np.random.default_rng(zlib.crc32(name.encode()) % 1000))


@pytest.mark.parametrize("name", BY_ROWS)
def test_what_the_rows_show_is_named_whatever_the_column(name):
    for number, machine in enumerate(VARIATIONS[name].only):
        run = spoiled(name, machine, ORDERS[number % 2])
        _, found = rows_alone(machine_named(machine), run)
        assert found, machine
        assert {one.name for one in found} <= set(VARIATIONS[name].says), machine


@pytest.mark.long
@pytest.mark.parametrize("number", range(len(OTHERS)))
def test_what_is_seen_against_the_machine_is_named(number):
    name = OTHERS[number]
    machines = VARIATIONS[name].only
    machine, order = machines[number % len(machines)], ORDERS[number // 2 % 2]
    outcome, words = said_of(
        VARIATIONS[name], machine_named(machine), spoiled(name, machine, order)
    )
    if name in NOT_ALONE:
        assert outcome != "silent", (machine, order)
    else:
        assert outcome not in WRONG, (machine, order, words)


@pytest.mark.parametrize("seed", [90289, 90631])
def test_joints_turned_are_no_station_that_moved_twice(seed: int) -> None:
    assert clean(seed) == ("joint-azimuth", ())


@pytest.mark.parametrize(
    ("masses", "unit"),
    [
        ([0.0, 13.23], "lb"),
        ([0.0, 13.2, 39.7], "lb"),
        ([0.0, 58.84], "newtons"),
        ([0.0, 6.0, 12.5], None),
        ([0.0, 13.2], None),
        ([0.0, 6.137], None),
        ([0.0, 6.0, 13.2277], "lb"),
    ],
)
def test_masses_are_of_another_unit_where_chance_would_not_make_them_round(masses, unit):
    """13.2 alone may well be kg: one mass in eleven of so few digits is round in lb."""
    found = in_other_unit(np.array(masses))
    assert (found[0].split(" ")[0] if found else None) == unit


@pytest.mark.parametrize(
    ("times", "told"),
    [
        ((86390.0, 10.0), "midnight"),
        ((7210.0, 3620.0), "summer time"),
        ((900.0, 0.0), "two files"),
    ],
)
def test_time_that_goes_back_is_refused_with_what_it_looks_like(times, told):
    header = (
        'format = "pkm-run/1"\nmachine = "tripod"\n[nests.platform]\np = [0.0, 0.0, 0.0]\n'
        "[nests.base]\na = [0.0, 0.0, 0.0]\nb = [1.0, 0.0, 0.0]\nc = [0.0, 1.0, 0.0]\n"
    )
    rows = "".join(f"{t},1,p,1,1,1,1,2,3,0.01,0.01,0.01\n" for t in times)
    with pytest.raises(BadInput, match="time goes back") as error:
        parse_run(header, f"time_s,pose,nest,q1,q2,q3,x,y,z,sx,sy,sz\n{rows}", actuators=3)
    assert told in error.value.remedy


def test_commands_whose_own_row_is_not_there_are_set_aside():
    name = "q three rows late"
    run, found = rows_alone(machine_named("hexapod"), spoiled(name, "hexapod", "nest-by-nest"))
    assert [one.name for one in found] == ["rows-shifted"]
    assert "three rows too late" in found[0].says
    assert settled(found)
    assert made("hexapod", "nest-by-nest").readings - run.readings <= 3
