"""The first look at runs with everyday mistakes: named, mended, nothing else said."""

import zlib
from dataclasses import replace

import numpy as np
import pytest

from bench._record_mistakes import MISTAKES, clean_run, machine_named
from calib.effects import effect_named
from calib.errors import BadInput
from calib.identify.staged import fit_effects
from calib.look import first_look
from calib.look.judged import record_of, settled
from calib.runs.record import Run
from calib.runs.remark import lines_in_words, ranges
from calib.runs.stack import Rows

MACHINES = ("hexapod", "tripod", "ptm")
ORDERS = ("nest-by-nest", "pose-by-pose")
GEOMETRIC = {
    "nests exchanged",
    "tracker moved by 20 to 50 mm",
    "SMR 0.5 to 3 mm larger in one nest",
}
"""Mistakes that are seen against the machine: asked of every machine."""
CASES = [
    (name, machine, ORDERS[(number + place) % 2])
    for number, name in enumerate(MISTAKES)
    for place, machine in enumerate(MACHINES if name in GEOMETRIC else MACHINES[:1])
]


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


@pytest.mark.parametrize(("name", "machine", "order"), CASES)
def test_a_mistake_is_named_and_mended(name, machine, order):
    make, expected = MISTAKES[name]
    seed = zlib.crc32(name.encode()) % 1000
    print("seed", seed)
    run = make(made(machine, order), np.random.default_rng(seed))
    rows = looked(machine, run)
    mirrored = {"nests-mirrored", "nests-exchanged"}  # some tables cannot tell these two apart
    said = {remark.name for remark in rows.remarks}
    assert len(rows.remarks) == 1
    assert said <= mirrored if expected in mirrored else said == {expected}
    fitted = fit_effects(rows, [effect_named(one, rows.machine) for one in rows.known])
    assert len(fitted.bad) == 0
    if settled(rows.remarks):
        assert fitted.chi2_per_dof < 1.6
    else:
        assert not settled(record_of(fitted))


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


def test_what_was_set_aside_stays_on_the_way_of_the_machine():
    make, _ = MISTAKES["zeros at the start"]
    run = made("hexapod", "pose-by-pose")
    whole, part = looked("hexapod", run), looked("hexapod", make(run, np.random.default_rng(0)))
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


def test_lines_are_told_in_ranges():
    assert ranges([3, 4, 5, 9]) == ((3, 5), (9, 9))
    assert ranges([3, 5, 9], among=[3, 5, 9, 11]) == ((3, 9),)
    assert lines_in_words(ranges([7])) == "line 7"
    assert lines_in_words(ranges([7, 8, 12])) == "lines 7-8, 12"
