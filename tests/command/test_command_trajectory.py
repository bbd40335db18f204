"""A stream of poses: in blocks of any size the commands are those of all poses together."""

import numpy as np
import pytest
from command_cases import LOAD, machine_of, wanted_of

from calib.command import Identified, Surroundings, Trajectory, commands_for, standpoint
from calib.effects import effect_named
from calib.errors import BadInput

PERIOD_S = 1e-3
HERE = Surroundings({"payload_kg": 3.0})
LOST_MM = 0.02


def identified() -> Identified:
    machine = machine_of("hexapod")
    values = {"gravity-sag.c": 2e-4, "screw-cyclic.period": 5.0}
    values |= {
        f"screw-cyclic.leg{leg}.{wave}": 0.01 for leg in range(1, 7) for wave in ("sin", "cos")
    }
    values |= {f"backlash.leg{leg}": LOST_MM for leg in range(1, 7)}
    effects = [effect_named(name, machine) for name in ("gravity-sag", "screw-cyclic", "backlash")]
    return Identified.from_values(machine, values, effects, LOAD)


def circle(poses: int, of: int = 4000) -> np.ndarray:
    """Task coordinates (6, poses) at the beginning of a circle of ``of`` poses."""
    angle = 2.0 * np.pi * np.arange(poses) / of
    zero = np.zeros(poses)
    return np.array([10 * np.sin(angle), 10 * np.cos(angle), 220 + zero, zero, zero, zero])


@pytest.mark.parametrize("block", [1, 7, 30])
def test_trajectory_in_blocks_is_the_trajectory(block: int) -> None:
    machine, wanted = identified(), circle(30)
    way = Trajectory(machine)
    parts = [way.solve(wanted[:, k : k + block], HERE) for k in range(0, 30, block)]
    whole = commands_for(machine, wanted, HERE)
    assert all(part.solved.all() for part in parts)
    np.testing.assert_allclose(np.concatenate([p.q for p in parts], axis=1), whole.q, atol=1e-6)


@pytest.mark.parametrize(("of", "asked"), [(4000, 1), (400, 2)])
def test_a_stream_of_single_poses_asks_the_effects_once_or_twice_each(of: int, asked: int) -> None:
    machine, wanted = identified(), circle(24, of)  # 0.016 and 0.16 mm a pose
    way = Trajectory(machine)
    alone = [way.solve(wanted[:, [k]], HERE) for k in range(24)]
    assert np.median([one.passes for one in alone[4:]]) == asked
    for one in alone[4:]:  # and what the machine then stands at is what was wanted
        at = standpoint(machine, one.extension, HERE, one.history)
        np.testing.assert_allclose(at.poses.to_xyz_rpy(), one.wanted, atol=1e-7)


def test_trajectory_of_small_steps_keeps_the_direction_of_lost_motion() -> None:
    wanted = circle(400)
    q = np.concatenate(list(Trajectory(identified()).blocks(wanted, PERIOD_S, HERE)), axis=1)
    step = np.diff(q, axis=1)[:, 1:]
    plain = np.diff(commands_for(Identified.from_values(machine_of("hexapod"), {}), wanted).q)[
        :, 1:
    ]
    assert np.abs(plain).max() < LOST_MM  # smaller than what a turn of a leg takes up
    turns = int(np.sum(np.diff(np.sign(plain), axis=1) != 0))
    jumps = int(np.sum(np.abs(step - plain) > 0.5 * LOST_MM))
    assert jumps == turns


def test_trajectory_that_only_asks_is_not_sent() -> None:
    way = Trajectory(identified())
    first = way.solve(circle(3), HERE, keep=False)
    assert way.history.count == 1
    np.testing.assert_array_equal(way.solve(circle(3), HERE).q, first.q)
    assert way.history.count > 1


def test_trajectory_says_which_pose_is_refused() -> None:
    wanted = circle(120)
    wanted[2, 70] = 900.0
    blocks = Trajectory(identified()).blocks(wanted, PERIOD_S, HERE)
    assert next(blocks).shape == (6, 50)
    with pytest.raises(BadInput, match="pose 71 of the trajectory: it passes a limit: q1"):
        next(blocks)


def test_a_machine_without_effects_is_closed_at_its_commands_as_one_with_effects_is():
    machine = machine_of("hexapod")
    bare = Identified(machine, machine.nominal + 0.3 * machine.prior_sigma)
    wanted = wanted_of("hexapod")
    found = commands_for(bare, wanted)
    asked = standpoint(bare, found.extension)
    assert found.passes == 1
    here, there = found.standing, asked
    np.testing.assert_allclose(here.poses.position, there.poses.position, rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(here.twists, there.twists, rtol=1e-8, atol=1e-10)
    with pytest.raises(BadInput, match="times that do not go back"):
        commands_for(bare, wanted, Surroundings({}, np.arange(wanted.shape[1])[::-1]))
    with pytest.raises(BadInput, match="payload_kg"):
        commands_for(bare, wanted, Surroundings({"payload_kg": np.nan}))


def test_lost_motion_is_taken_up_as_drives_can_follow_it() -> None:
    hard = 100.0  # mm/s^2
    turn = np.linspace(0.0, 1.0, 2200)
    angle = 2.0 * np.pi * turn**3 * (10.0 - 15.0 * turn + 6.0 * turn**2)  # at rest at both ends
    zero = np.zeros(angle.size)
    wanted = np.array([3 * np.sin(angle), 3 - 3 * np.cos(angle), 220 + zero, zero, zero, zero])
    sharp = np.concatenate(list(Trajectory(identified()).blocks(wanted, PERIOD_S, HERE)), axis=1).T
    easy = Trajectory(identified()).rows(wanted, PERIOD_S, HERE, acceleration=np.full(6, hard))

    def hardest(q: np.ndarray) -> float:
        return float(np.abs(np.diff(q, n=2, axis=0)).max() / PERIOD_S**2)

    assert hardest(sharp) > 100 * hard
    assert hardest(easy) < hard
    assert np.abs(easy - sharp).max() <= 0.5 * LOST_MM + 1e-4
    ramp = 2.0 * np.sqrt(LOST_MM / (0.5 * hard)) / PERIOD_S
    turns = np.abs(np.diff(sharp, n=2, axis=0)).max(axis=1) / PERIOD_S**2 > 100 * hard
    near = np.convolve(np.r_[False, turns, False], np.ones(2 * int(ramp) + 3), mode="same") > 0.5
    np.testing.assert_allclose(easy[~near], sharp[~near], rtol=0.0, atol=1e-9)
    assert np.mean(~near) > 0.3
