"""Poses for heights, and what heights leave open."""

import json

import numpy as np
import pytest

from app.cli import run as pkmcal
from calib.identify import fit
from calib.model import Model
from calib.poses.information import prior, whitened_rows
from calib.poses.reach import sample_poses
from calib.poses.readings import DirectionReadings
from calib.runs import parse_run
from calib.runs.stack import stack
from mocks.simulate.kinds import Laboratory
from tests.mechanism.conftest import load

UP = np.array([[0.0], [0.0], [1.0]])


def test_the_information_of_heights_is_that_of_a_fit_to_heights() -> None:
    """The design's covariance of the geometry against the fit's, readings at the same poses."""
    machine = load("delta")
    poses = sample_poses(machine, 25, np.random.default_rng(3))
    readings = DirectionReadings(np.zeros((3, 1)), UP, 0.01)
    known = prior(poses, readings, priors=True)
    rows = whitened_rows(poses, readings, known.scale).reshape(known.scale.size, -1)
    designed = np.linalg.inv(known.information + rows @ rows.T)
    header = {"machine": "delta", "nests": {"platform": {"tool": [0.0, 0.0, 0.0]}}}
    header["instruments"] = {"probe": {"frame": "base"}}
    lab = Laboratory(header, {"tool": np.zeros(3)}, {}, 3, np.random.default_rng(1))
    for k in range(poses.count):
        position, rotation = poses.poses.position[:, k], poses.poses.rotation[:, :, k]
        lab.go(f"{k}", poses.q[:, k].tolist(), position, rotation)
        lab.point("tool", 0.01, by="probe", only="z")
    found = fit(Model(stack(machine, [parse_run(*lab.texts(), actuators=3)])))
    sigmas = np.sqrt(np.diag(designed)) * known.scale
    assert found.sigmas == pytest.approx(sigmas, rel=0.02)


def test_poses_are_chosen_for_heights(capsys) -> None:
    asked = ["poses", "delta", "--heights", "--n", "6", "--candidates", "40", "--json"]
    assert pkmcal(asked) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["readings"] == "heights of the platform's origin, +-10 um (1 sigma)"
    chosen, drawn = said["predicted"], said["random_poses"]
    assert chosen["position_rms_um"] <= drawn["position_rms_um"]
    assert pkmcal([*asked, "--angle-mdeg", "1"]) == 2


def test_heights_leave_open_where_the_machine_stands_in_the_plane(capsys) -> None:
    asked = ["identifiability", "delta", "--read", "heights", "--poses", "30", "--json"]
    assert pkmcal(asked) == 0
    said = capsys.readouterr().out
    assert "heights" in said
