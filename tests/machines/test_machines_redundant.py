"""More actuators than commanded coordinates: seven-axis arms, eight legs on one platform."""

import numpy as np
import pytest

from calib.arrays import Array
from calib.errors import BadInput
from calib.mechanism.check import require_sound
from calib.mechanism.description import Machine
from calib.mechanism.parse import parse_machine
from calib.mechanism.solve import forward, home_configuration, inverse
from calib.poses.reach import sample_poses

SEVEN = """
format = "pkm-machine/1"
name = "seven"
[home]
pose = { x = 712.903761, y = 82.0331637, z = 664.319156, rx = "170 deg", ry = "60 deg", \
rz = "180 deg" }
[workspace]
x = [600.0, 760.0]
y = [0.0, 160.0]
z = [580.0, 720.0]
rx = ["165 deg", "175 deg"]
ry = ["55 deg", "65 deg"]
rz = ["175 deg", "179 deg"]
[actuators]
q1 = { unit = "rad", home = 0.0, limits = ["-170 deg", "170 deg"] }
q2 = { unit = "rad", home = "30 deg", limits = ["-120 deg", "120 deg"] }
q3 = { unit = "rad", home = "10 deg", limits = ["-170 deg", "170 deg"] }
q4 = { unit = "rad", home = "60 deg", limits = ["-120 deg", "120 deg"] }
q5 = { unit = "rad", home = 0.0, limits = ["-170 deg", "170 deg"] }
q6 = { unit = "rad", home = "30 deg", limits = ["-120 deg", "120 deg"] }
q7 = { unit = "rad", home = 0.0, limits = ["-175 deg", "175 deg"] }
[limbs.arm]
chain = "Rz:q1 tz:360 Ry:q2 tx:a2 Rz:q3 tz:a3 Ry:q4 Rz:q5 tz:a5 Ry:q6 Rz:q7 tz:126"
[limbs.arm.parameters]
a2 = { unit = "mm", tolerance = 0.5, nominal = 0.0 }
a3 = { unit = "mm", tolerance = 0.5, nominal = 420.0 }
a5 = { unit = "mm", tolerance = 0.5, nominal = 400.0 }
"""


def eight(*, cables: bool = False) -> str:
    """Eight telescopic legs from the corners of a room to the corners of a box; or eight ropes."""
    boxes = [f'{name} = ["-5 deg", "5 deg"]' for name in ("rx", "ry", "rz")]
    text = ['format = "pkm-machine/1"', 'name = "eight"', "[home]", "pose = { z = 400.0 }"]
    text += ["[workspace]", "x = [-60.0, 60.0]", "y = [-60.0, 60.0]", "z = [340.0, 460.0]"]
    text += [*boxes, "[actuators]"]
    legs = []
    for k, (a, b, c) in enumerate(np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T, 1):
        base = np.array([500.0 * a, 400.0 * b, 450.0 * (c + 1)])
        corner = np.array([60.0 * b, -70.0 * a, -40.0 * c])
        if cables:  # these can hold one another taut
            corner = np.array([-60.0 * a, 70.0 * b, 40.0 * c])
        way = np.array([0.0, 0.0, 400.0]) + corner - base
        length = float(np.linalg.norm(way))
        x, y, z = way / length
        first, second = np.arctan2(-y, z), np.arcsin(x)
        spring = "rope=ctz:1e-4" if cables else "ctz:1e-5"
        legs.append(
            f'[limbs.leg{k}]\nchain = "tx:{base[0]} ty:{base[1]} tz:{base[2]} Rx({first:.6f}) '
            f"Ry({second:.6f}) Tz:q{k}+L0 {spring} Ry({-second:.6f}) Rx({-first:.6f}) Rz "
            f'tx:{-corner[0]} ty:{-corner[1]} tz:{-corner[2]}"\n'
            + (f'[limbs.leg{k}.traits]\npulls = "rope"\n' if cables else "")
            + f'[limbs.leg{k}.parameters]\nL0 = {{ unit = "mm", tolerance = 0.5, nominal = 0.0 }}'
        )
        text.append(f'q{k} = {{ unit = "mm", home = {length!r}, limits = [200.0, 1200.0] }}')
    return "\n".join([*text, *legs])


@pytest.fixture(scope="module", params=["seven", "eight"])
def machine(request: pytest.FixtureRequest) -> Machine:
    text = SEVEN if request.param == "seven" else eight()
    made = parse_machine(text, f"{request.param}.toml")
    require_sound(made, text)
    return made


def near_home(machine: Machine, count: int, seed: int) -> Array:
    size = 0.2 if machine.axes[0].unit == "rad" else 0.0
    noise = np.random.default_rng(seed).standard_normal((len(machine.actuators), count))
    return machine.home_q[:, None] + size * noise


def test_what_is_commanded_is_q_and_the_pose_follows(machine: Machine) -> None:
    found = inverse(machine, _poses(machine))
    assert found.converged.all()
    again = forward(machine, found.extension)
    assert again.converged.all()
    assert np.allclose(again.poses.position, found.poses.position, atol=1e-7)
    assert np.allclose(again.poses.rotation, found.poses.rotation, atol=1e-9)


def test_an_elbow_that_was_moved_is_another_command_for_the_same_pose() -> None:
    machine = parse_machine(SEVEN, "seven.toml")
    moved = forward(machine, near_home(machine, 20, 3))
    found = inverse(machine, moved.poses)
    assert found.converged.all()
    assert np.abs(found.extension - moved.extension).max() > 0.01
    near = inverse(machine, moved.poses, start=moved)
    assert np.allclose(near.extension, moved.extension, atol=1e-8)


def test_legs_of_a_wanted_pose_do_not_strain() -> None:
    machine = parse_machine(eight(), "eight.toml")
    found = inverse(machine, _poses(machine))
    assert max(float(np.abs(strain).max()) for strain in found.strain) < 1e-7


def test_a_leg_that_is_too_long_is_shared_by_all() -> None:
    machine = parse_machine(eight(), "eight.toml")
    home = home_configuration(machine)
    one = home.extension + np.eye(8)[:, :1] * 0.1
    moved = forward(machine, one)
    shift = float(np.linalg.norm(moved.poses.position - home.poses.position))
    assert 0.0 < shift < 0.1
    assert max(float(np.abs(strain).max()) for strain in moved.strain) > 1e-3


def test_poses_of_the_workspace_are_reached(machine: Machine) -> None:
    chosen = sample_poses(machine, 12, np.random.default_rng(5))
    assert chosen.count == 12


def test_more_coordinates_than_actuators_are_refused() -> None:
    text = SEVEN.replace("Ry:q6 Rz:q7", "Ry:q6").replace(
        'q7 = { unit = "rad", home = 0.0, limits = ["-175 deg", "175 deg"] }', ""
    )
    parse_machine(text, "six.toml")
    with pytest.raises(BadInput, match="6 task coordinates for 5 actuators"):
        parse_machine(
            text.replace("Ry:q6 ", "").replace(
                'q6 = { unit = "rad", home = "30 deg", limits = ["-120 deg", "120 deg"] }', ""
            ),
            "five.toml",
        )


def _poses(machine: Machine) -> Array:
    low, high = np.array([machine.workspace[name] for name in machine.task.coordinates]).T
    unit = np.random.default_rng(2).random((6, 20))
    values: Array = low[:, None] + (high - low)[:, None] * (0.3 + 0.4 * unit)
    return values
