"""Runs whose nests or directions scatter otherwise than stated: said so, and effects stay found."""

from dataclasses import replace

import pytest

from app.files.machines import load_machine
from bench._blind_noise import nest_of, noisy
from calib.discover.discovery import Refitter, discover_run
from calib.discover.report import discovery_report
from calib.effects import catalogue
from calib.runs import parse_run
from calib.runs.stack import stack
from mocks.hidden.table import Hidden
from mocks.simulate.files import points_csv, run_toml
from mocks.simulate.plan import RunPlan
from mocks.simulate.run import simulate

SIGMA_MM = 0.005
PLAN = RunPlan(machine="hexapod", seed=31, poses=40, noise_mm=SIGMA_MM, prior="normal")
WORN = Hidden({"backlash.leg3": 0.03})


def discovered(condition: str, hidden: Hidden) -> dict:
    """The answer of discovery on a run under a condition of the noise."""
    machine = load_machine("hexapod")
    plan = replace(PLAN, hidden=hidden)
    run = simulate(plan)
    run = replace(run, xyz=noisy(simulate(replace(plan, noise_mm=1e-9)), condition, SIGMA_MM, 2))
    rows = stack(machine, [parse_run(run_toml(run), points_csv(run), actuators=6)])
    return discovery_report(discover_run(Refitter(rows, catalogue(machine))))


@pytest.mark.parametrize(
    ("condition", "of_what"),
    [
        ("nest:1.7", f"nest {nest_of(simulate(PLAN))}"),
        pytest.param("along:1.6", "along the beam", marks=pytest.mark.long),
    ],
)
@pytest.mark.parametrize(
    "hidden",
    [Hidden({}), pytest.param(WORN, marks=pytest.mark.long)],
    ids=["clean", "backlash"],
)
def test_what_scatters_more_is_named_beside_the_effect(
    condition: str, of_what: str, hidden: Hidden
) -> None:
    report = discovered(condition, hidden)
    assert report["effects"] == (["backlash"] if hidden is WORN else [])
    assert report["adequate"]
    (told,) = [one for one in report["noise"]["components"] if one["clear"]]
    assert (told["name"], told["of_what"], told["unit"]) == ("scale-of", of_what, "1")
    truth = float(condition.partition(":")[2])
    assert abs(told["value"] - truth) < 4.0 * told["sigma"]
    assert of_what in report["advice"]
    assert "times what is stated" in report["advice"]
