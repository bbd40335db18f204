"""Where a model was measured, how far outside a pose lies, and how sure a command is."""

from dataclasses import replace

import numpy as np
import pytest
from command_cases import drawn, machine_of, wanted_of

from calib.command import PoseCovariance, Region, commands_for, standpoint
from calib.command.uncertainty import pose_columns
from calib.effects import catalogue
from calib.identify import fit
from calib.mechanism.rigid import pose_difference
from calib.model import Model
from calib.model.prototype import prototype_run
from calib.poses import sample_poses
from calib.runs.stack import stack


@pytest.fixture(scope="module")
def measured():
    machine, generator = machine_of("hexapod"), np.random.default_rng(2)
    poses = sample_poses(machine, 12, generator)
    run = prototype_run(machine, "hexapod", poses, machine.nominal, 0.005, generator).run
    return machine, poses, fit(Model(stack(machine, [run])))


def test_command_region_is_where_the_poses_of_the_fit_were(measured):
    machine, poses, found = measured
    region = Region.of_fit(found)
    assert region.poses == 12
    for k, name in enumerate(machine.task.coordinates):
        assert np.allclose(region.task[name], [poses.task[k].min(), poses.task[k].max()], atol=0.05)
    assert region.walls(machine).outside(poses.task, poses.q, {}) == []


def test_command_outside_is_told_with_how_far(measured):
    machine, poses, found = measured
    region = Region.of_fit(found)
    task = poses.task[:, :2].copy()
    low, high = region.task["z"]
    task[2] = high + 0.09 * (high - low), low - 0.5 * (high - low)
    one, *more = region.walls(machine).outside(task, np.full((6, 2), np.nan), {})
    assert more == []
    assert (one.pose, one.name) == (1, "z")
    assert one.beyond == pytest.approx(0.5 * (high - low))
    assert f"z is {one.beyond:.4g} mm beyond what was measured ({low:.6g} to" in str(one)
    task = poses.task[:, :1].copy()
    task[5] = region.task["rz"][1] + np.deg2rad(40.0)
    (turned,) = region.walls(machine).outside(task, poses.q[:, :1], {})
    assert str(turned).startswith("rz is 40 deg beyond")


def test_command_columns_of_a_pose_are_differences_of_where_it_stands():
    machine, generator = machine_of("hexapod"), np.random.default_rng(3)
    effects = [e for e in catalogue(machine) if e.id in ("screw-twist", "screw-pitch")]
    identified = drawn(machine, effects, generator)
    found = commands_for(identified, wanted_of("hexapod"))
    columns = dict(zip(identified.names, pose_columns(found.standing), strict=True))

    def moved(name, step):
        if name in machine.parameter_index:
            values = identified.parameters.copy()
            values[machine.parameter_index[name]] += step
            return replace(identified, parameters=values)
        changed = []
        for one in identified.effects:
            values = one.values + step * np.array([own == name for own in one.names])
            changed.append(replace(one, values=values))
        return replace(identified, effects=tuple(changed))

    for name, step in (("leg2.B_x", 1e-3), ("screw-twist.L", 1e-3), ("screw-pitch.leg3", 1e-6)):
        ahead, back = (
            standpoint(moved(name, sign * step), found.extension).poses for sign in (1.0, -1.0)
        )
        slope = pose_difference(back, ahead) / (2.0 * step)
        assert np.allclose(columns[name], slope, rtol=2e-2, atol=2e-2 * np.abs(slope).max())
    names, sigma = ["leg2.B_x", "frame.x"], np.array([0.1, 5.0])
    covariance = PoseCovariance(identified, names, np.diag(sigma**2)).at(found.standing)
    own = columns["leg2.B_x"] * 0.1
    assert np.allclose(covariance, own[:, None] * own[None], atol=1e-15)
