"""The first look at runs with everyday mistakes: named, mended, nothing else said."""

import zlib
from dataclasses import replace
from functools import lru_cache, partial

import numpy as np
import pytest

from bench.mistakes import MISTAKES, Mistake
from bench.mistakes.clean import clean_run, machine_named
from bench.mistakes.variations import VARIATIONS
from calib.effects import effect_named
from calib.errors import BadInput
from calib.identify.staged import fit_effects
from calib.look import first_look
from calib.look.conventions import check_conventions
from calib.look.first import _surely, rows_alone
from calib.look.judged import record_of, settled
from calib.look.places import places_of
from calib.look.proposal import Proposal
from calib.mechanism.rigid import exponential
from calib.runs.record import Run
from calib.runs.remark import lines_in_words, ranges
from calib.runs.sensing import POINT, Instrument, Sensing, Setup
from calib.runs.stack import Rows
from mocks.simulate.plan import Profile

MACHINES = ("hexapod", "tripod", "ptm")
ORDERS = ("nest-by-nest", "pose-by-pose")
ROWS = [
    name
    for words in (
        "points in m from", "sigmas in um from the middle", "three sigmas",
        "points rounded", "time", "temperature",
        "air in", "-127", "85 and 999", "two values of 0", "payload", "gravity in", "is zero",
        "centres of mass", "mass in grams", "zeros", "-1, -1, -1", "z is 0", "repeat",
        "no longer change", "y stands", "twice", "sorted by text", "one label", "labels begin",
    )
    for name in MISTAKES
    if words in name and name not in VARIATIONS and name != "tracker moved twice"
]  # fmt: skip
"""Mistakes that the rows show by themselves: asked of every machine, in both orders."""
PLACES = {
    "nests exchanged": MACHINES,
    "nests exchanged from the middle on": MACHINES[:1],
    "nest table mirrored in x": MACHINES,
    "tracker moved by 10 mm after 5 %": MACHINES[:1],
    "tracker moved by 20 to 50 mm": MACHINES[:2],
    "tracker moved by 10 mm after 95 %": MACHINES[:1],
    "tracker moved by 0.2 to 1 mm": MACHINES[:1],
    "SMR 0.5 to 3 mm larger in one nest": MACHINES,
    "sigmas in um": MACHINES[:1],
    "sigmas in m": MACHINES[:1],
    "sigmas are variances": MACHINES[1:2],
    "nests go round": MACHINES[1:2],
    "base nests exchanged": MACHINES[:1],
    "nest table turned by 90 deg": MACHINES[:1],
    "nest table 25 mm off in z": MACHINES[:1],
    "nest table: one sign wrong": MACHINES[1:2],
    "nest table: one number 0.6 to 2 mm off": MACHINES[:2],
    "tracker moved, base nests read at the start alone": MACHINES[1:2],
    "an actuator clamped from two thirds on": MACHINES[1:2],
    "an actuator slipped by 20 to 100 um": MACHINES[:1],
    "an actuator slipped by 0.2 to 1 mm": MACHINES[1:2],
    "controller parameters not the stated": MACHINES[:1],
}
"""Mistakes that are seen against the machine."""
CASES = [
    (name, machine, ORDERS[(number + place) % 2])
    for number, (name, machines) in enumerate(PLACES.items())
    for place, machine in enumerate(machines)
]


@lru_cache(maxsize=8)
def made(machine: str, order: str, seed: int = 5) -> Run:
    return clean_run(machine, seed, poses=20, order=order)


def looked(machine: str, run: Run) -> Rows:
    return first_look(machine_named(machine), [run])


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("machine", MACHINES)
def test_a_clean_run_has_no_remark_and_stays_as_it_is(machine, order):
    run = made(machine, order)
    rows = looked(machine, run)
    assert rows.remarks == ()
    assert rows.known == {}
    assert np.array_equal(rows.position, run.position[:, run.measured])


def spoiled(mistake: Mistake, name: str, run: Run) -> Run:
    seed = zlib.crc32(name.encode()) % 1000
    print("seed", seed)
    return mistake.make(run, np.random.default_rng(seed))


@pytest.mark.parametrize("name", dict.fromkeys(ROWS))
def test_what_the_rows_show_is_named(name):
    for machine in MISTAKES[name].only:
        for order in ORDERS:
            clean = made(machine, order)
            _, remarks = rows_alone(machine_named(machine), spoiled(MISTAKES[name], name, clean))
            assert {one.name for one in remarks} <= set(MISTAKES[name].says), (machine, order)
            assert len(remarks) >= 1, (machine, order)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("machine", MACHINES)
def test_the_rows_of_a_clean_run_show_nothing(machine, order):
    clean = made(machine, order)
    run, remarks = rows_alone(machine_named(machine), clean)
    assert remarks == []
    assert run is clean


@pytest.mark.parametrize(("name", "machine", "order"), CASES)
def test_a_mistake_is_named_and_mended(name, machine, order):
    rows = looked(machine, spoiled(MISTAKES[name], name, made(machine, order)))
    assert len(rows.remarks) == 1
    assert {remark.name for remark in rows.remarks} <= set(MISTAKES[name].says)
    fitted = fit_effects(rows, [effect_named(one, rows.machine) for one in rows.known])
    assert len(fitted.bad) == 0
    assert settled(rows.remarks)
    assert fitted.chi2_per_dof < 1.6


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("machine", MACHINES)
def test_commands_a_row_late_are_put_back(machine, order):
    name = "q one row late"
    rows = looked(machine, spoiled(MISTAKES[name], name, made(machine, order)))
    assert [one.name for one in rows.remarks] == ["rows-shifted"]
    assert "q1.. stand one row too late" in rows.remarks[0].says
    fitted = fit_effects(rows, [])
    assert len(fitted.bad) <= 3  # the last row's own command is nowhere in the file
    assert fitted.chi2_per_dof < 1.6


REFUSED = {
    "points in m": "hexapod",
    "x and y of the points exchanged": "tripod",
    "two columns of q exchanged": "hexapod",
    "one column of q stands": "hexapod",
    "q in degrees": "ptm",
}
"""Mistakes that make of a record that of another machine."""


@pytest.mark.long
@pytest.mark.parametrize("name", REFUSED)
def test_what_would_be_another_machine_is_refused_in_words(name):
    machine = REFUSED[name]
    with pytest.raises(BadInput, match=MISTAKES[name].refused):
        looked(machine, spoiled(MISTAKES[name], name, made(machine, "pose-by-pose")))


def test_what_only_a_wide_slack_bears_out_does_not_end_the_search():
    machine, clean = machine_named("hexapod"), made("hexapod", "pose-by-pose")
    q = clean.q.copy()
    q[[1, 4]] = q[[4, 1]]
    places = places_of(machine, replace(clean, q=q))
    wide = replace(places, slack=60.0 * places.tight)
    assert wide.standing > wide.strict.standing + wide.limit
    useless, right = (
        Proposal(places.rows.count, partial(tuple, (one, None)))
        for one in (
            wide.run,
            clean,
        )
    )
    assert _surely(machine, wide, useless) == 0
    assert _surely(machine, wide, right) == places.rows.count
    assert _surely(machine, places.strict, useless) == places.rows.count
    with pytest.raises(BadInput, match="q2 and q5"):
        check_conventions(machine, wide.run, wide, _surely(machine, wide, useless))


@pytest.mark.long
def test_rows_that_slid_are_put_back():
    name = "x, y, z one row late from the middle on"
    rows = looked("hexapod", spoiled(MISTAKES[name], name, made("hexapod", "pose-by-pose")))
    assert {one.name for one in rows.remarks} <= set(MISTAKES[name].says)
    fitted = fit_effects(rows, [])
    assert len(fitted.bad) <= 1
    assert fitted.chi2_per_dof < 1.6


@pytest.mark.parametrize(
    ("name", "expected", "told"),
    [
        ("one q of one pose mistyped", "pose-actuator", "mistyped"),
        ("a base nest knocked by 0.3 to 2 mm", "nest-moved", "moved before line"),
        ("base table: one number 1 to 10 mm off", "nest-moved", "is not where the table says"),
    ],
)
def test_excluded_readings_that_have_something_in_common_are_said_so(name, expected, told):
    run = clean_run("hexapod", 5, poses=24, order="pose-by-pose")
    rows = looked("hexapod", spoiled(MISTAKES[name], name, run))
    (one,) = record_of(fit_effects(rows, []))
    assert one.name == expected
    assert told in one.says


def test_the_moment_and_the_size_of_a_move_are_found():
    run = made("hexapod", "pose-by-pose")
    read = np.flatnonzero(run.measured)
    position = run.position.copy()
    position[:, read[-9:]] += np.array([[0.0], [40.0], [0.0]])
    rows = looked("hexapod", replace(run, position=position))
    (remark,) = rows.remarks
    assert remark.lines[0][0] == run.line[read[-9]]
    fitted = fit_effects(rows, [effect_named("frame-shift", rows.machine)])
    at = fitted.model.free.size
    assert np.linalg.norm(fitted.values[at : at + 3]) == pytest.approx(40.0, abs=0.05)
    moment = fitted.values[at + 6]
    assert run.time_s[read[-10]] <= moment <= run.time_s[read[-9]] + 5.0


def test_how_far_the_tracker_itself_was_carried_is_told():
    run = made("hexapod", "pose-by-pose")
    read = np.flatnonzero(run.measured)
    turn = exponential(np.array([0.0, 0.0, 0.02]))
    position = run.position.copy()
    position[:, read[40:]] = turn @ position[:, read[40:]] + np.array([[30.0], [0.0], [0.0]])
    rows = looked("hexapod", replace(run, position=position))
    shift = effect_named("frame-shift", rows.machine)
    (remark,) = record_of(fit_effects(rows, [shift]))
    assert remark.says.endswith("If it was the tracker, it went 30 mm and turned by 20 mrad")


def test_a_station_that_moved_twice_has_three_frames():
    run = made("hexapod", "pose-by-pose")
    read = np.flatnonzero(run.measured)
    position = run.position.copy()
    for first, shift in ((25, 30.0), (55, -18.0)):
        position[:, read[first:]] += np.array([[shift], [0.0], [5.0]])
    rows = looked("hexapod", replace(run, position=position))
    (remark,) = rows.remarks
    assert remark.name == "station-moved"
    assert len(rows.runs) == 3
    fitted = fit_effects(rows, [])
    assert len(fitted.bad) == 0
    assert fitted.chi2_per_dof < 1.6


@pytest.mark.long
def test_a_station_that_moved_twice_by_little_has_three_frames():
    name = "tracker moved twice"
    rows = looked("hexapod", spoiled(MISTAKES[name], name, made("hexapod", "pose-by-pose")))
    (remark,) = rows.remarks
    assert remark.name == "station-moved"
    assert len(rows.runs) == 3
    assert fit_effects(rows, []).chi2_per_dof < 1.6


def test_runs_of_two_machines_are_said_to_be_such():
    run = made("hexapod", "pose-by-pose")
    other = replace(run, header=replace(run.header, controller_serial="2"))
    run = replace(run, header=replace(run.header, controller_serial="1"))
    rows = first_look(machine_named("hexapod"), [run, other])
    assert [one.name for one in rows.remarks] == ["several-machines"]
    assert not settled(rows.remarks)


@pytest.mark.parametrize(
    ("turn", "expected"), [([0, 2, 1], ["gravity-direction"]), ([0, 1, 2], [])]
)
def test_gravity_in_another_direction_than_the_weight_is_said(turn, expected):
    heavy = Profile(rise_K=0.0, payload_kg=(0.0, 12.0))
    run = clean_run("hexapod", 7, poses=20, hidden={"gravity-sag.c": 3e-4}, profile=heavy)
    load = replace(run.header.load, gravity=run.header.load.gravity[turn])
    rows = looked("hexapod", replace(run, header=replace(run.header, load=load)))
    assert [one.name for one in rows.remarks] == expected
    assert settled(rows.remarks) == (not expected)


def test_what_was_set_aside_stays_on_the_way_of_the_machine():
    mistake = MISTAKES["zeros at the start"]
    run = made("hexapod", "pose-by-pose")
    whole, part = looked("hexapod", run), looked("hexapod", spoiled(mistake, "zeros", run))
    kept = np.isin(whole.line, part.line)
    assert part.count < whole.count
    assert np.array_equal(part.direction, whole.direction[:, kept])


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda q: q / 1000.0, "look like m"),
        (lambda q: q - 230.715, "changes from home"),
        (lambda q: -q, "wrong sign"),
    ],
)
def test_coordinates_nowhere_near_the_travel_are_refused_in_words(change, told):
    run = made("hexapod", "pose-by-pose")
    with pytest.raises(BadInput, match=told) as refused:
        looked("hexapod", replace(run, q=change(run.q)))
    assert "line 2" in refused.value.place


@pytest.mark.parametrize(("factor", "told"), [(180.0 / np.pi, "degrees"), (1000.0, "mrad")])
def test_angles_in_another_unit_are_refused_in_words(factor, told):
    run = made("ptm", "pose-by-pose")
    with pytest.raises(BadInput, match=told):
        looked("ptm", replace(run, q=factor * run.q))


@pytest.mark.long
def test_many_excluded_readings_are_never_silent():
    run = made("hexapod", "pose-by-pose")
    generator = np.random.default_rng(3)
    read = np.flatnonzero(run.measured)
    wrong = generator.choice(read, 8, replace=False)
    position = run.position.copy()
    position[:, wrong] += generator.choice([-1.0, 1.0], (3, 8)) * generator.uniform(20, 60, (3, 8))
    rows = looked("hexapod", replace(run, position=position))
    record = record_of(fit_effects(rows, []))
    assert [one.name for one in record] == ["many-excluded"]
    assert not settled(record)


def version_2(run: Run, nests: dict[str, np.ndarray]) -> Run:
    """The run as version 2 writes it: points of a tracker, some nests with a prior."""
    count = run.line.size
    sensing = Sensing(
        kind=np.where(run.measured, POINT, -1),
        instrument=("tracker",) * count,
        second=("",) * count,
        plane=("",) * count,
        ends=np.full((2, count), -1),
        seen=np.tile(run.measured, (3, 1)),
        axis=np.zeros((3, count)),
        attitude=np.repeat(np.eye(3)[:, :, None], count, axis=2),
        spread=np.zeros((6, 6, count)),
    )
    setup = Setup({"tracker": Instrument()}, {}, nests)
    return replace(run, sensing=sensing, header=replace(run.header, setup=setup))


@pytest.mark.parametrize(
    "name", ["zeros at the start", "readings no longer change", "nests exchanged", "sigmas in um"]
)
def test_points_of_version_2_are_looked_at_like_those_of_version_1(name):
    run = version_2(made("hexapod", "pose-by-pose"), {"b1": 1e-4 * np.eye(3)})
    rows = looked("hexapod", spoiled(MISTAKES[name], name, run))
    assert {one.name for one in rows.remarks} & set(MISTAKES[name].says)
    assert len(rows.remarks) == 1
    assert fit_effects(rows, []).chi2_per_dof < 1.6


def test_readings_in_nests_that_are_roughly_known_are_not_placed():
    run = made("hexapod", "pose-by-pose")
    first = next(iter(run.header.platform_nests))
    table = {**run.header.platform_nests, first: run.header.platform_nests[first] + 15.0}
    run = replace(run, header=replace(run.header, platform_nests=table))
    assert looked("hexapod", version_2(run, {first: 400.0 * np.eye(3)})).remarks == ()


def test_lines_are_told_in_ranges():
    assert ranges([3, 4, 5, 9]) == ((3, 5), (9, 9))
    assert ranges([3, 5, 9], among=[3, 5, 9, 11]) == ((3, 9),)
    assert lines_in_words(ranges([7])) == "line 7"
    assert lines_in_words(ranges([7, 8, 12])) == "lines 7-8, 12"
