"""A plain fit takes readings as independent, and says so where they are not."""

from dataclasses import replace

import numpy as np
import pytest

from app.files.machines import load_machine
from bench._blind_noise import CONDITIONS, noisy
from calib.discover.agreement import successive_alike
from calib.identify.staged import fit_effects
from calib.runs import parse_run
from calib.runs.stack import stack
from mocks.simulate.files import points_csv, run_toml
from mocks.simulate.plan import RunPlan
from mocks.simulate.run import simulate

SIGMA_MM = 0.005
PLAN = RunPlan(machine="hexapod", seed=21, poses=20, noise_mm=SIGMA_MM, prior="normal")


@pytest.mark.parametrize(("condition", "says"), [("ar:0", False), ("ar:0.6", True)])
def test_readings_that_err_alike_are_told(condition: str, says: bool) -> None:
    machine = load_machine("hexapod")
    run = simulate(PLAN)
    quiet = simulate(replace(PLAN, noise_mm=1e-9))
    run = replace(run, xyz=noisy(quiet, condition, SIGMA_MM, 3))
    rows = stack(machine, [parse_run(run_toml(run), points_csv(run), actuators=6)])
    told = successive_alike(fit_effects(rows, []))
    assert bool(told) is says
    assert not says or "independent" in told


@pytest.mark.parametrize("name", ["ar:0.5", "t:5", "scale:1.3"])
def test_the_bench_makes_the_noise_that_it_names(name: str) -> None:
    run = simulate(replace(PLAN, noise_mm=1e-9, poses=150))
    drawn = CONDITIONS[name.partition(":")[0]](
        run, float(name.partition(":")[2]), np.random.default_rng(4)
    )
    spread = 1.3 if name == "scale:1.3" else 1.0
    assert drawn.std() == pytest.approx(spread, rel=0.08)
    alike = float(np.mean(drawn[1:] * drawn[:-1]) / drawn.var())
    assert alike == pytest.approx(0.5 if name == "ar:0.5" else 0.0, abs=0.08)
