"""Poses are chosen so that they can be measured again once the machine has been calibrated."""

from pathlib import Path

import numpy as np
import pytest

from app.files.machines import load_machine
from app.jobs.posing import choose_poses
from app.session.path import check_waypoints
from calib.arrays import Array
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.mechanism.limits import within_limits
from calib.mechanism.solve import inverse
from calib.poses import sample_poses, verification_poses
from calib.poses.margin import tolerance_margin

MACHINES = 10


def within_tolerance(machine: Machine, seed: int) -> Array:
    """Parameters of one machine as it might be made."""
    share = np.random.default_rng(seed).uniform(-1.0, 1.0, machine.nominal.size)
    return np.asarray(machine.nominal + share * machine.tolerance)


def named(machine: Machine, parameters: Array) -> dict[str, float]:
    return {p.name: float(v) for p, v in zip(machine.parameters, parameters, strict=True)}


@pytest.mark.long
@pytest.mark.parametrize("name", ["hexapod", "tripod"])
def test_what_is_kept_free_is_enough_for_machines_within_tolerance(name: str) -> None:
    machine = load_machine(name)
    margin = tolerance_margin(machine)
    poses = sample_poses(machine, 100, np.random.default_rng(3), margin)
    plain = sample_poses(machine, 100, np.random.default_rng(3))
    outside = 0
    for seed in range(MACHINES):
        parameters = within_tolerance(machine, seed)
        held = named(machine, parameters)
        closed = inverse(machine, poses.task, parameters, poses.configuration)
        assert np.all(within_limits(machine, closed, held)), f"seed {seed}"
        assert np.all(within_limits(machine, closed)), f"seed {seed}, by the drawing"
        elsewhere = inverse(machine, plain.task, parameters, plain.configuration)
        outside += int(np.sum(~within_limits(machine, elsewhere, held)))
    assert outside > 0


@pytest.mark.long
def test_the_whole_way_is_accepted_by_calibrated_controllers() -> None:
    machine = load_machine("hexapod")
    chosen = choose_poses("hexapod", 29, candidates=150)
    labels = ["home", *chosen.by_label(), "home"]
    path = [machine.home, *chosen.by_label().values(), machine.home]
    for seed in range(MACHINES):
        check_waypoints(machine, named(machine, within_tolerance(machine, seed)), path, labels)


@pytest.mark.long
def test_the_grid_is_reached_by_machines_within_tolerance() -> None:
    machine = load_machine("tripod")
    grid = verification_poses(machine).pose_set
    for seed in range(MACHINES):
        parameters = within_tolerance(machine, seed)
        closed = inverse(machine, grid.task, parameters, grid.configuration)
        assert np.all(within_limits(machine, closed, named(machine, parameters))), f"seed {seed}"


def test_the_site_may_keep_more_free(tmp_path: Path) -> None:
    def kept(margin_mm: float | None) -> Array:
        chosen = choose_poses("hexapod", 3, candidates=20, margin_mm=margin_mm)
        low, high = load_machine("hexapod").q_limits.T
        q = np.array([pose.q for pose in chosen.poses])
        free = np.array([one.each_end for one in chosen.kept_free])
        assert np.all((q >= low + free) & (q <= high - free))
        return free

    assert kept(2.0) == pytest.approx(kept(None) + 1.9)
    with pytest.raises(BadInput, match="margin-mm"):
        choose_poses("hexapod", 3, candidates=20, margin_mm=-1.0)
