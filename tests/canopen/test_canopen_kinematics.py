"""The controller's own closed-form kinematics: a published number, laws, the engine beside it."""

import numpy as np
import pytest

from calib.mechanism.rigid import Poses
from calib.mechanism.solve import inverse
from mocks.canopen.hexapod_kinematics import (
    PARAMETERS,
    HexapodKinematics,
    leg_length,
    leg_lengths,
    rotation,
)
from mocks.canopen.unreachable import Unreachable
from mocks.physics.truth import draw_parameters, machine_file, nominal_parameters

MACHINE = machine_file("hexapod")
HOME = (0.0, 0.0, 220.0, 0.0, 0.0, 0.0)


def random_poses(count: int, seed: int = 11) -> np.ndarray:
    half = [15.0, 15.0, 15.0, 0.15, 0.15, 0.2]
    return np.random.default_rng(seed).uniform(-1, 1, (count, 6)) * half + HOME


def table(values: dict[str, float]) -> list[list[float]]:
    return [[values[f"leg{n}.{name}"] for name in PARAMETERS] for n in range(1, 7)]


def test_home_length_is_the_one_of_the_notes():
    lengths = leg_lengths(HOME, table(nominal_parameters(MACHINE)))
    assert lengths == pytest.approx([230.7148097226] * 6, abs=1e-9)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_closed_form_agrees_with_the_engine(seed: int):
    truth = draw_parameters(MACHINE, seed)
    poses = random_poses(40, seed)
    solved = inverse(MACHINE, Poses.from_xyz_rpy(poses.T), MACHINE.vector(truth)[:, None])
    expected = MACHINE.coordinates(solved.extension, truth)
    lengths = [HexapodKinematics().targets(pose, truth) for pose in poses.tolist()]
    np.testing.assert_allclose(np.transpose(lengths), expected, atol=1e-9)


def test_moving_both_ends_alike_changes_nothing():
    values = draw_parameters(MACHINE, 5)
    shifted = {n: v + 7.0 if n.endswith((".B_x",)) else v for n, v in values.items()}
    for pose in random_poses(10).tolist():
        moved = [pose[0] + 7.0, *pose[1:]]
        assert leg_lengths(moved, table(shifted)) == pytest.approx(
            leg_lengths(pose, table(values)), abs=1e-10
        )


def test_envelope_theorem():
    """dl/dB = -u and dl/dL_B = -u . n_B although psi moves: the second axis is square to u."""
    values = table(draw_parameters(MACHINE, 6))
    step = 1e-4
    for pose in random_poses(5).tolist():
        x, y, z, *angles = pose
        rows = rotation(*angles)
        for leg, own in enumerate(values):

            def length(column: int, change: float, leg=leg, own=own, rows=rows, at=(x, y, z)):
                changed = list(own)
                changed[column] += change
                return leg_length(at, rows, leg, changed)

            gradient = np.array(
                [(length(c, step) - length(c, -step)) / (2 * step) for c in (0, 1, 2)]
            )
            assert np.linalg.norm(gradient) == pytest.approx(1.0, abs=1e-7)
            platform = np.array(
                [(length(c, step) - length(c, -step)) / (2 * step) for c in (3, 4, 5)]
            )
            np.testing.assert_allclose(np.array(rows) @ platform, -gradient, atol=1e-7)


def test_platform_below_the_base_is_unreachable():
    with pytest.raises(Unreachable) as error:
        leg_lengths((0.0, 0.0, -220.0, 0.0, 0.0, 0.0), table(nominal_parameters(MACHINE)))
    assert error.value.leg == 0
