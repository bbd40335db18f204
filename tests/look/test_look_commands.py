"""Coordinates of actuators that a stretch of the rows has otherwise: found, and put back."""

from dataclasses import replace

import numpy as np
import pytest

from bench.mistakes.clean import clean_run, machine_named
from calib.look import first_look
from calib.look.places import places_of
from calib.look.rewritten_commands import rewritten_commands
from calib.runs.record import Run


def exchanged(q, home):
    return q[[4, 1, 2, 3, 0, 5]]


def turned_round(q, home):
    return np.concatenate([q[:2], 2.0 * home[2:3, None] - q[2:3], q[3:]])


def reversed_(q, home):
    return q[::-1]


def written(run: Run, way, first: float, last: float) -> Run:
    """The run whose rows from one part to another have q another way."""
    home = machine_named("hexapod").home_q
    place = np.arange(run.line.size) / run.line.size
    there = (place >= first) & (place < last)
    return replace(run, q=np.where(there, way(run.q, home), run.q))


@pytest.mark.parametrize(
    ("order", "way", "says", "first", "last"),
    [
        ("nest-by-nest", exchanged, "q1 and q5 are exchanged", 0.6, 1.0),
        ("pose-by-pose", exchanged, "q1 and q5 are exchanged", 0.35, 0.6),
        ("nest-by-nest", turned_round, "q3 has the wrong sign about home", 0.35, 0.6),
        ("pose-by-pose", reversed_, "the actuators are in reversed order", 0.0, 0.4),
    ],
)
def test_a_stretch_that_is_written_otherwise_is_put_back(order, way, says, first, last):
    clean = clean_run("hexapod", 3, poses=24, order=order)
    run = written(clean, way, first, last)
    places = places_of(machine_named("hexapod"), run)
    assert places is not None
    found = rewritten_commands(places)
    assert found is not None
    meant, remark = found.take()
    assert says in remark.says
    on = np.array([name in run.header.platform_nests for name in run.nest])
    wrong = on & run.measured & np.any(np.abs(meant.q - clean.q) > 1e-9, axis=0)
    assert wrong.sum() <= 2  # an edge where both ways stand


def test_a_clean_run_and_a_run_wrong_throughout_have_no_stretch():
    machine = machine_named("hexapod")
    clean = clean_run("hexapod", 3, poses=24, order="pose-by-pose")
    for run in (clean, written(clean, reversed_, 0.0, 1.0)):
        places = places_of(machine, run)
        assert places is None or rewritten_commands(places) is None


def test_labels_are_their_own_again_once_q_is_put_back():
    machine = machine_named("hexapod")
    clean = clean_run("hexapod", 3, poses=24, order="nest-by-nest")
    rows = first_look(machine, [written(clean, exchanged, 0.4, 1.0)])
    assert [one.name for one in rows.remarks] == ["q-rewritten"]
    assert rows.runs[0].pose == clean.pose
