"""Fit, compare and design count with the noise that was estimated; white runs are as before."""

import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.files.machines import load_machine
from app.jobs.comparing import compare
from app.jobs.fitting import fit
from bench._blind_noise import noisy
from calib.discover.follow_up import FollowUp
from calib.discover.plain_noise import only_noise_is_off, with_own_noise
from calib.effects import catalogue
from calib.identify.staged import fit_effects
from calib.noise import Noise
from calib.poses.reach import sample_poses
from calib.runs import parse_run
from calib.runs.stack import stack
from mocks.simulate.files import points_csv, run_toml
from mocks.simulate.plan import RunPlan
from mocks.simulate.run import simulate

SIGMA_MM = 0.005
PLAN = RunPlan(machine="hexapod", seed=3, poses=20, noise_mm=SIGMA_MM, prior="normal")


def written(folder: Path, condition: str) -> str:
    """A run on the disk under a condition of the noise."""
    quiet = simulate(replace(PLAN, noise_mm=1e-9))
    run = replace(simulate(PLAN), xyz=noisy(quiet, condition, SIGMA_MM, 3))
    folder.mkdir()
    (folder / "run.toml").write_text(run_toml(run))
    (folder / "points.csv").write_text(points_csv(run))
    return str(folder)


def test_a_fit_counts_with_its_noise_and_the_model_file_keeps_it(tmp_path: Path) -> None:
    run, model = written(tmp_path / "run", "ar:0.7"), tmp_path / "model.toml"
    found = fit(run)
    (told,) = [one for one in found.noise.components if one.clear]
    assert told.name == "correlated"
    assert any(one.startswith("As to noise: the noise is correlated") for one in found.remarks)
    assert not any("Successive readings" in one for one in found.remarks)
    assert found.noise.uncertainty_ratio != 1.0
    found.save(model)
    assert tomllib.loads(model.read_text())["noise"]["tau_s"] == pytest.approx(told.value)
    again = fit(run, model=model)
    assert again.noise == found.noise
    assert [one.sigma for one in again.parameters] == pytest.approx(
        [one.sigma for one in found.parameters], rel=1e-6
    )
    known = compare(run, model=model)
    assert known.noise == again.noise
    assert not any(one.significant for one in known.structure)


def test_a_fit_to_white_readings_is_left_as_it_is() -> None:
    for seed in range(4):
        run = simulate(replace(PLAN, seed=seed))
        rows = stack(
            load_machine("hexapod"), [parse_run(run_toml(run), points_csv(run), actuators=6)]
        )
        found = fit_effects(rows, [])
        assert not only_noise_is_off(found)
        assert with_own_noise(found, lambda: catalogue(rows.machine)) is found  # noqa: B023


def test_readings_to_come_are_worth_what_their_noise_leaves_of_them() -> None:
    run = simulate(PLAN)
    machine = load_machine("hexapod")
    rows = stack(machine, [parse_run(run_toml(run), points_csv(run), actuators=6)])
    white = fit_effects(rows, [])
    poses = sample_poses(machine, 5, np.random.default_rng(1))
    before = FollowUp(white, poses, {})
    noise = Noise(scale=2.0, scatter=(("nest b1", 1.5),))
    after = FollowUp(replace(white, noise=noise), poses, {})
    factor = np.where(np.array(before.rows.nest_name) == "b1", 3.0, 2.0)
    np.testing.assert_allclose(factor * after.geometry, before.geometry, rtol=1e-9, atol=1e-9)
    visit = FollowUp(replace(white, noise=Noise(visit=1.0)), poses, {})
    worth = [np.sum(one.geometry**2) for one in (before, visit)]
    assert worth[1] < 0.9 * worth[0]
