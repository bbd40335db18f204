"""Machines drawn within their tolerances: against the linear prediction, and whoever does them."""

import json
import os
import signal
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import pkmcal
from app.cli import run
from app.files.machines import load_machine
from app.spread import spread
from calib.analysis.coverage import workspace_poses
from calib.analysis.observation import Sights, judge, observe
from calib.analysis.sensitivity import sensitivity
from calib.analysis.trials import Errors, calibrated, uncalibrated
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.poses.information import covariance
from calib.poses.readings import DirectionReadings, PoseNoise

NESTS = np.array([[60.0, -40.0, 0.0], [0.0, 50.0, -70.0], [10.0, 5.0, 20.0]])
BASE = np.array([[200.0, -150.0, 0.0], [0.0, 170.0, -220.0], [0.0, 0.0, 10.0]])
NONE = np.zeros((3, 0))
SIGHTS = {
    "nests": Sights(NESTS, base=BASE, frame_free=True),
    "nests to be found": Sights(NESTS, base=BASE, frame_free=True, nests_free=True),
    "whole poses": Sights(NONE, base=BASE, frame_free=True, pose_noise=PoseNoise(0.01, 4e-5)),
    "heights": Sights(
        NONE, pose_noise=DirectionReadings(NESTS, np.array([[0.0], [0.0], [1.0]]), 0.01)
    ),
}


def narrow(machine: Machine, part: float) -> Machine:
    """The same machine from a better shop: its prediction is linear."""
    parameters = tuple(
        replace(p, tolerance=part * p.tolerance, sigma=part * p.sigma) for p in machine.parameters
    )
    return replace(machine, parameters=parameters)


def seeds(count: int) -> list[tuple[int, ...]]:
    return [(7, number) for number in range(count)]


def rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(values**2)))


@pytest.mark.parametrize("name", ["hexapod", "tripod", "delta"])
def test_machines_of_small_tolerances_are_off_as_the_linear_sum_says(name: str) -> None:
    machine = narrow(load_machine(name), 0.01)
    poses = workspace_poses(machine, 20, np.random.default_rng(1))
    linear, found = sensitivity(poses), uncalibrated(poses, seeds(150))
    assert rms(found.position) == pytest.approx(linear.position_sigma, rel=0.15)
    assert np.all(found.largest >= found.position)


@pytest.mark.parametrize("kind", SIGHTS)
def test_calibrations_leave_what_is_predicted_and_know_how_sure_they_are(kind: str) -> None:
    machine, sights = load_machine("hexapod"), SIGHTS[kind]
    generator = np.random.default_rng(2)
    poses, fresh = (workspace_poses(machine, count, generator) for count in (40, 20))
    observation = observe(poses, sights)
    information = observation.A.T @ observation.A + np.diag(observation.prior)
    predicted = judge(fresh, observation).accuracy(covariance(information))
    found = calibrated(poses, fresh, sights, seeds(60))
    assert 1e3 * rms(found.errors.position) == pytest.approx(predicted.position_um, rel=0.2)
    assert np.std(found.pulls) == pytest.approx(1.0, abs=0.12)


def test_a_machine_is_the_same_whatever_others_are_asked_for() -> None:
    machine = load_machine("hexapod")
    generator = np.random.default_rng(3)
    poses, fresh = (workspace_poses(machine, 30, generator) for _ in range(2))
    whole = calibrated(poses, fresh, SIGHTS["nests"], seeds(7))
    alone = calibrated(poses, fresh, SIGHTS["nests"], seeds(7)[4:5])
    np.testing.assert_allclose(alone.pulls[:, 0], whole.pulls[:, 4], rtol=1e-6, atol=1e-8)
    of = Errors.joined([uncalibrated(poses, seeds(2)), uncalibrated(poses, seeds(5)[2:])])
    np.testing.assert_allclose(of.position, uncalibrated(poses, seeds(5)).position, rtol=1e-9)


def test_machines_that_cannot_take_the_poses_are_counted_apart() -> None:
    wide = narrow(load_machine("hexapod"), 400.0)
    poses = workspace_poses(load_machine("hexapod"), 10, np.random.default_rng(4))
    found = uncalibrated(replace(poses, machine=wide), seeds(6))
    assert np.isnan(found.position).any()


def asked(words: list[str], capsys: pytest.CaptureFixture[str]) -> dict[str, object]:
    assert run([*words, "--json"]) == 0
    found: dict[str, object] = json.loads(capsys.readouterr().out)
    return found


def test_studies_do_not_hang_on_who_does_them(capsys: pytest.CaptureFixture[str]) -> None:
    words = ["sensitivity", "hexapod", "--poses", "5", "--monte-carlo", "60"]
    alone = asked([*words, "--workers", "1"], capsys)
    assert alone["drawn"] == asked([*words, "--workers", "2"], capsys)["drawn"]
    assert isinstance(alone["drawn"], dict)
    assert alone["drawn"]["machines"] == 60
    assert asked(["sensitivity", "hexapod", "--poses", "5"], capsys)["drawn"] is None


def test_the_best_of_several_searches_comes_again_by_its_seed(tmp_path: Path) -> None:
    few = {"candidates": 14, "workers": 1}
    best = pkmcal.choose_poses("hexapod", 10, searches=3, **few)
    again = pkmcal.choose_poses("hexapod", 10, seed=best.seed, candidates=14)
    assert best.seed in (1, 2, 3)
    assert [one.q for one in again.poses] == [one.q for one in best.poses]
    best.save(tmp_path / "poses.toml")
    assert f"--seed {best.seed}" in (tmp_path / "poses.toml").read_text()
    assert "--searches" not in (tmp_path / "poses.toml").read_text()


def test_a_scheduler_that_is_not_there_is_said_by_every_study(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("app.spread.CONNECT_S", 0.3)
    nowhere = "tcp://127.0.0.1:1"
    for study in (
        lambda: pkmcal.sensitivity("delta", poses=5, monte_carlo=2, scheduler=nowhere),
        lambda: pkmcal.choose_poses("delta", 3, candidates=5, searches=2, scheduler=nowhere),
    ):
        with pytest.raises(BadInput, match=r"no Dask scheduler answers|Dask is not installed"):
            study()


@pytest.mark.long
def test_studies_on_dask_are_those_of_this_process_though_a_worker_is_killed() -> None:
    distributed = pytest.importorskip("distributed", reason="Dask is not installed")
    from app.jobs.drawing import _Question, answer_for

    poses = workspace_poses(load_machine("hexapod"), 20, np.random.default_rng(5))
    questions = [_Question(poses, ((5, number),)) for number in range(12)]
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None
    ) as cluster:
        there = {}
        for number, one in spread(answer_for, questions, scheduler=cluster.scheduler_address):
            if not there:
                os.kill(cluster.workers[0].pid, signal.SIGKILL)
            there[number] = one
        study = pkmcal.identifiability(
            "delta", poses=30, monte_carlo=60, scheduler=cluster.scheduler_address
        )
    for number, question in enumerate(questions):
        assert there[number].position == answer_for(question).position
    here = pkmcal.identifiability("delta", poses=30, monte_carlo=60, workers=1)
    assert study.drawn == here.drawn
