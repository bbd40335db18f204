"""Poses for heights, and what heights leave open."""

import json

import numpy as np
import pytest

from app.cli import run as pkmcal
from calib.identify import fit
from calib.mechanism.rigid import Poses, exponential, product
from calib.model import Model
from calib.poses.gauges import DistanceReadings, TiltReadings, gauge_poses, to_span
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


def twisted(poses: Poses, twist: np.ndarray) -> Poses:
    """Platforms moved by a small twist [v; w] each, base axes."""
    turn = exponential(np.repeat(twist[3:, None], poses.count, axis=1))
    return Poses(poses.position + twist[:3, None], product(turn, poses.rotation))


@pytest.mark.parametrize("what", ["distance", "tilt"])
def test_the_root_of_a_number_is_its_derivative_by_the_twist(what: str) -> None:
    """K^T K against differences of what the instrument reads, pose by pose."""
    poses = sample_poses(load("hexapod"), 7, np.random.default_rng(5)).poses
    nest, far = np.array([10.0, 90.0, -20.0]), np.array([200.0, 30.0, -50.0])
    axis, up = np.array([0.6, 0.0, 0.8]), np.array([0.0, 0.0, 1.0])

    def read(at: Poses) -> np.ndarray:
        if what == "tilt":
            return np.arcsin(np.einsum("ijn,j->in", at.rotation, axis)[2])
        point = at.position + np.einsum("ijn,j->in", at.rotation, nest)
        return np.linalg.norm(point - far[:, None], axis=0)

    readings = (
        TiltReadings(axis, up, 0.5)
        if what == "tilt"
        else DistanceReadings((nest[:, None], far[:, None]), 0.5)
    )
    step = 1e-6
    slope = [
        (read(twisted(poses, step * e)) - read(twisted(poses, -step * e))) / (2.0 * step)
        for e in np.eye(6)
    ]
    r = np.array(slope) / 0.5
    K = readings.root(poses)
    np.testing.assert_allclose(
        np.einsum("kin,kjn->ijn", K, K), np.einsum("in,jn->ijn", r, r), atol=2e-6 * np.max(r**2)
    )


def test_the_pairs_of_marks_that_are_chosen_tell_more_than_others(capsys) -> None:
    asked = ["poses", "delta", "--heights", "--n", "10", "--candidates", "60", "--json"]
    assert pkmcal([*asked, "--calipers", "4"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert len(set(said["pairs"])) == 4
    assert said["with_pairs"]["position_rms_um"] < 0.95 * said["predicted"]["position_rms_um"]
    assert pkmcal([*asked, "--calipers", "46"]) == 2
    assert "46 distances of 45 pairs" in capsys.readouterr().err


def test_poses_are_brought_to_where_a_bar_is_in_range() -> None:
    machine = load("hexapod")
    ends = (np.array([[0.0], [100.0], [0.0]]), np.array([[0.0], [260.0], [-30.0]]))
    draw = gauge_poses(machine, to_span(ends, (299.0, 301.0)), ())
    found = draw(25, np.random.default_rng(2))
    at = found.poses.position + np.einsum("ijn,j->in", found.poses.rotation, ends[0][:, 0])
    length = np.linalg.norm(at - ends[1], axis=0)
    assert found.count == 25
    assert np.all(np.abs(length - 300.0) < 1.0)
