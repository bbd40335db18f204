"""Several runs, of which one does not say what the machine carried; or each says something else."""

from dataclasses import replace

import numpy as np
import pytest
from effects_rows import readings_of

from calib.effects import effect_named
from calib.model import Model
from calib.model.columns import channels_known
from calib.runs.header import Load
from calib.runs.record import Run
from calib.runs.stack import Rows, stack

WEIGHED = ("gravity-sag", "leg-compliance", "loaded-backlash")


def carrying(run: Run, load: Load | None) -> Run:
    return replace(run, header=replace(run.header, load=load))


def twice(name: str, second: Load | None) -> Rows:
    """The same commands in two runs, the second with another load, or none stated."""
    rows = readings_of(name)
    (run,) = rows.runs
    return stack(rows.machine, [run, carrying(run, second)])


@pytest.mark.parametrize("name", WEIGHED)
def test_weight_is_asked_of_the_run_that_states_it(name: str) -> None:
    rows = twice("hexapod", None)
    effect = effect_named(name, rows.machine)
    assert effect.unavailable(rows) == ""
    known = channels_known(effect, rows)
    assert np.array_equal(known, (rows.run == 0) | ~rows.on_platform)
    neither = stack(rows.machine, [rows.runs[1]])
    assert effect.unavailable(neither) == "run.toml has no [load]"


def test_runs_at_the_same_commands_under_another_load_are_states_of_their_own() -> None:
    plain = twice("hexapod", readings_of("hexapod").runs[0].header.load)
    effect = effect_named("gravity-sag", plain.machine)
    first, of = Model(plain, [effect]).states
    assert not set(of[plain.run == 0]) & set(of[plain.run == 1])
    assert first.size == 2 * Model(stack(plain.machine, plain.runs[:1]), [effect]).states[0].size
