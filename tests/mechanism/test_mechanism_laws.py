"""Laws that hold for every machine that ships: closure, inverses, derivatives, rigid motion."""

from importlib.resources import files

import numpy as np
import pytest

from calib.mechanism.compiled import compile_machine
from calib.mechanism.description import Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.rigid import Poses, cross, pose_difference, rotate
from calib.mechanism.solve import Configuration, forward, home_configuration, inverse
from calib.mechanism.sweep import Standing, sweep
from calib.mechanism.task import task_values
from tests.mechanism.conftest import load, manufactured, reachable

SHIPPED = sorted(
    entry.name.removesuffix(".toml")
    for entry in files("calib.machines").iterdir()
    if entry.name.endswith(".toml")
)
POSES = 40


@pytest.fixture(scope="module", params=SHIPPED)
def machine(request: pytest.FixtureRequest) -> Machine:
    return load(request.param)


@pytest.fixture(scope="module")
def configuration(machine: Machine) -> Configuration:
    return reachable(machine, POSES, seed=1)


def test_home_closes_at_the_stated_actuator_coordinates(machine: Machine) -> None:
    home = home_configuration(machine)
    assert home.converged.all()
    again = inverse(machine, task_values(machine.task, home.poses))
    assert machine.coordinates(again.extension)[:, 0] == pytest.approx(machine.home_q, abs=1e-9)


def test_every_limb_ends_at_the_platform(machine: Machine, configuration: Configuration) -> None:
    """Exactly, once the elastic strains are taken as joints."""
    poses = configuration.poses
    state = Standing.of(configuration)
    for g, group in enumerate(compile_machine(machine).groups):
        point, rotation, _ = sweep(
            group,
            machine.nominal[:, None],
            configuration.extension,
            state,
            configuration.strain[g],
        )
        gap = np.broadcast_to(point, (3, group.count, POSES)) - poses.position[:, None]
        assert np.abs(gap).max() < 1e-9
        assert np.abs(rotation - poses.rotation[:, :, None]).max() < 1e-11


def test_forward_undoes_inverse(machine: Machine, configuration: Configuration) -> None:
    there = forward(machine, configuration.extension)
    assert there.converged.all()
    difference = pose_difference(configuration.poses, there.poses)
    assert np.abs(difference[:3]).max() < 1e-9
    assert np.abs(difference[3:]).max() < 1e-11


def test_inverse_undoes_forward_with_errors(machine: Machine, configuration: Configuration) -> None:
    built = manufactured(machine, seed=2)
    there = forward(machine, configuration.extension, built)
    back = inverse(machine, task_values(machine.task, there.poses), built, start=there)
    assert there.converged.all()
    assert back.converged.all()
    assert np.abs(back.extension - configuration.extension).max() < 1e-9


def test_one_parameter_vector_a_pose_equals_one_for_all(
    machine: Machine, configuration: Configuration
) -> None:
    built = manufactured(machine, seed=3)
    one = forward(machine, configuration.extension, built)
    each = forward(machine, configuration.extension, np.repeat(built[:, None], POSES, axis=1))
    assert np.abs(pose_difference(one.poses, each.poses)).max() < 1e-10


def complex_step(
    machine: Machine, configuration: Configuration, parameters: np.ndarray, extension: np.ndarray
) -> np.ndarray:
    """Twist (6, N) per unit of the imaginary perturbation of 1e-30."""
    moved = forward(machine, extension, parameters, start=configuration)
    moved = forward(machine, extension, parameters, start=moved)
    position = np.imag(moved.poses.position) / 1e-30
    spin = np.imag(moved.poses.rotation) / 1e-30
    base = np.real(moved.poses.rotation)
    omega = 0.5 * sum(cross(base[:, j], spin[:, j]) for j in range(3))
    return np.concatenate([position, omega])


@pytest.mark.long
def test_jacobians_against_complex_step(machine: Machine, configuration: Configuration) -> None:
    few = configuration.take(slice(0, 6))
    jacobians = pose_jacobians(machine, few)
    scale = np.abs(jacobians.parameters).max()
    for k in range(len(machine.parameters)):
        values = machine.nominal.astype(complex)
        values[k] += 1e-30j
        numeric = complex_step(machine, few, values, few.extension)
        assert np.abs(numeric - jacobians.parameters[k]).max() < 1e-11 * max(scale, 1.0)
    for k in range(len(machine.actuators)):
        extension = few.extension.astype(complex)
        extension[k] += 1e-30j
        numeric = complex_step(machine, few, machine.nominal, extension)
        largest = max(np.abs(jacobians.actuators[k]).max(), 1.0)
        assert np.abs(numeric - jacobians.actuators[k]).max() < 1e-11 * largest


def test_exact_minus_linear_falls_with_the_square(
    machine: Machine, configuration: Configuration
) -> None:
    errors = manufactured(machine, seed=4, share=0.1) - machine.nominal
    jacobian = pose_jacobians(machine, configuration).parameters
    linear = np.einsum("pin,p->in", jacobian, errors)
    left = []
    for size in (1.0, 0.25):
        exact = forward(machine, configuration.extension, machine.nominal + size * errors)
        moved = pose_difference(configuration.poses, exact.poses)
        left.append(np.sqrt(np.mean((moved - size * linear) ** 2)))
    slope = np.log(left[0] / left[1]) / np.log(4.0)
    assert slope == pytest.approx(2.0, abs=0.05)


def test_a_pose_that_is_no_number_does_not_disturb_the_others(
    machine: Machine, configuration: Configuration
) -> None:
    spoilt = configuration.extension.copy()
    spoilt[0, 3] = np.nan
    there = forward(machine, spoilt)
    assert not there.converged[3]
    assert there.converged[np.arange(POSES) != 3].all()


def test_nominal_errors_of_zero_change_nothing(
    machine: Machine, configuration: Configuration
) -> None:
    there = forward(machine, configuration.extension, machine.nominal)
    points = np.array([[10.0], [20.0], [30.0]])
    moved = there.poses.points(points) - configuration.poses.points(points)
    assert np.abs(moved).max() < 1e-9
    assert rotate(there.poses.rotation, points).shape == (3, POSES)
    assert isinstance(there.poses, Poses)
