"""What a discovery holds is freed when nobody asks for it, without the collector of cycles."""

import gc
import weakref
from pathlib import Path

from app.files.runs import read_run
from calib.discover.discovery import Refitter
from calib.effects import effect_named
from calib.runs.stack import stack

RUNS = Path(__file__).parents[1] / "data" / "runs"


def test_stages_and_their_columns_go_with_the_refitter():
    loaded = read_run(RUNS / "no-effect")
    rows = stack(loaded.machine, [loaded.run])
    refit = Refitter(rows, [effect_named("backlash", loaded.machine)])
    stage = refit(())
    assert stage.run.effects
    held = [weakref.ref(one) for one in (refit, stage, stage.fit, stage.run.effects[0])]
    gc.disable()
    try:
        del refit, stage
        assert [one() for one in held] == [None] * len(held)
    finally:
        gc.enable()
