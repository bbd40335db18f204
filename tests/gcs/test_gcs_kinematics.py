"""The controller's closed form: its own inverse, and the same as the engine's."""

import numpy as np
import pytest

from calib.mechanism.rigid import Poses
from calib.mechanism.solve import inverse
from mocks.gcs.tripod_kinematics import Unreachable, position_of, slider_places
from mocks.physics.truth import draw_parameters, machine_file, nominal_parameters

MACHINE = machine_file("tripod")


def positions(count: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return rng.uniform([-50.0, -50.0, -200.0], [50.0, 50.0, -100.0], (count, 3))


@pytest.mark.parametrize("seed", range(5))
def test_forward_of_inverse_is_the_position(seed: int):
    values = draw_parameters(MACHINE, seed)
    for position in positions(20, seed):
        places = slider_places(position, values)
        assert position_of(places, values) == pytest.approx(tuple(position), abs=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_same_slider_places_as_the_engine(seed: int):
    values = draw_parameters(MACHINE, seed)
    wanted = positions(10, seed)
    poses = Poses.from_xyz_rpy(np.hstack([wanted, np.zeros_like(wanted)]).T)
    vector = np.array([values[p.name] for p in MACHINE.parameters])
    extension = inverse(MACHINE, poses, vector).extension
    ours = np.array([slider_places(position, values) for position in wanted]).T - 410.0
    assert ours == pytest.approx(extension, abs=1e-7)


def test_home():
    home = (0.0, 0.0, -np.sqrt(260.0**2 - 230.0**2))
    assert slider_places(home, nominal_parameters(MACHINE)) == pytest.approx((410.0,) * 3)


def test_out_of_reach_is_said():
    with pytest.raises(Unreachable):
        slider_places((0.0, 0.0, -261.0), nominal_parameters(MACHINE))
    with pytest.raises(Unreachable):
        position_of((460.0, 460.0, 460.0), nominal_parameters(MACHINE))
