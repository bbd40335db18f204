"""Laws of chains that nobody has drawn: composed as matrices would be, with true derivatives."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.parse import parse_machine
from calib.mechanism.rigid import pose_difference
from calib.mechanism.solve import forward, inverse
from calib.mechanism.task import task_values

LENGTH = st.floats(50.0, 500.0).map(lambda x: round(x, 3))
ANGLE = st.floats(-1.5, 1.5).map(lambda x: round(x, 4))
SERIOUS = settings(max_examples=15, deadline=None, derandomize=True)


@st.composite
def serial_chains(draw):
    """Six driven joints with fixed transforms and parameters between: (token, kind, axis, value).

    ``value`` is what the element moves by at home; a driven joint's is its home.
    """
    elements = []
    for joint in range(6):
        turns = joint not in draw(st.sets(st.integers(0, 5), max_size=2))
        axis = draw(st.sampled_from("xyz"))
        home = draw(ANGLE if turns else LENGTH)
        elements.append((f"{'R' if turns else 'T'}{axis}:q{joint + 1}", turns, axis, home))
        for number in range(draw(st.integers(1, 2))):
            name, axis = f"p{joint}{number}", draw(st.sampled_from("xyz"))
            fixed = draw(st.sampled_from(["tx", "r"]))
            turns, value = fixed == "r", draw(ANGLE if fixed == "r" else LENGTH)
            token = f"{'r' if turns else 't'}{axis}:{name}"
            if draw(st.booleans()):
                token = token.replace(name, f"{value!r}")
            elements.append((token, turns, axis, value))
    return elements


def composed(elements, moved):
    """Position (3,) and rotation (3, 3): what matrices give, without the program's own code."""
    place, turn = np.zeros(3), Rotation.identity()
    for (_, turns, axis, _), value in zip(elements, moved, strict=True):
        along = np.eye(3)["xyz".index(axis)]
        if turns:
            turn = turn * Rotation.from_rotvec(value * along)
        else:
            place = place + turn.apply(value * along)
    return place, turn.as_matrix()


def machine_of(elements):
    """The same as a machine file."""
    place, turn = composed(elements, [value for *_, value in elements])
    rz, ry, rx = Rotation.from_matrix(turn).as_euler("ZYX")
    lines = [
        'format = "pkm-machine/1"', 'name = "random"', "[home]",
        f"pose = {{ x = {place[0]!r}, y = {place[1]!r}, z = {place[2]!r}, "
        f"rx = {rx!r}, ry = {ry!r}, rz = {rz!r} }}",
        "[workspace]", *(f"{c} = [-1e4, 1e4]" for c in "xyz"),
        *(f"{c} = [-3.0, 3.0]" for c in ("rx", "ry", "rz")), "[actuators]",
    ]  # fmt: skip
    lines = [line.replace("np.float64(", "").replace(")", "") for line in lines]
    for token, turns, _, value in elements:
        if token[0] in "RT":
            q, unit = token.split(":")[1], "rad" if turns else "mm"
            low, high = (value - 3.0, value + 3.0) if turns else (value - 900.0, value + 900.0)
            lines.append(f'{q} = {{ unit = "{unit}", home = {value!r}, limits = [{low}, {high}] }}')
    lines += ["[limbs.arm]", f'chain = "{" ".join(token for token, *_ in elements)}"']
    lines.append("[limbs.arm.parameters]")
    for token, turns, _, value in elements:
        name = token.split(":")[1]
        if token[0] in "rt" and name[0] == "p":
            unit, tolerance = ("rad", 1e-3) if turns else ("mm", 0.1)
            lines.append(
                f'{name} = {{ unit = "{unit}", tolerance = {tolerance}, nominal = {value!r} }}'
            )
    return parse_machine("\n".join(lines), "random.toml")


def moved_at(elements, q):
    """What every element moves by when the joints stand at q (6,)."""
    left = iter(q)
    return [next(left) if token[0] in "RT" else value for token, _, _, value in elements]


@SERIOUS
@given(serial_chains(), st.integers(0, 2**32 - 1))
def test_mechanism_chain_is_the_product_of_its_elements(elements, seed):
    machine = machine_of(elements)
    q = machine.home_q[:, None] + np.random.default_rng(seed).uniform(-1.0, 1.0, (6, 4))
    there = forward(machine, machine.extension(q))
    assert there.converged.all()
    for pose in range(q.shape[1]):
        place, turn = composed(elements, moved_at(elements, q[:, pose]))
        np.testing.assert_allclose(there.poses.position[:, pose], place, atol=1e-6)
        np.testing.assert_allclose(there.poses.rotation[:, :, pose], turn, atol=1e-9)


@pytest.mark.long
@SERIOUS
@given(serial_chains(), st.integers(0, 2**32 - 1))
def test_mechanism_chain_has_the_derivatives_of_its_differences(elements, seed):
    machine = machine_of(elements)
    q = machine.home_q[:, None] + np.random.default_rng(seed).uniform(-1.0, 1.0, (6, 1))
    extension, held = machine.extension(q), machine.nominal
    here = forward(machine, extension)
    own = pose_jacobians(machine, here, held)

    def slope(change):
        step = 1e-5
        ahead, back = (forward(machine, *change(s * step), start=here).poses for s in (1.0, -1.0))
        return pose_difference(back, ahead) / (2.0 * step)

    for actuator in range(6):
        unit = np.eye(6)[:, [actuator]]
        found = slope(lambda step, unit=unit: (extension + step * unit, held))
        np.testing.assert_allclose(own.actuators[actuator], found, atol=1e-4)
    for index in range(held.size):
        unit = np.eye(held.size)[index]
        found = slope(lambda step, unit=unit: (extension, held + step * unit))
        np.testing.assert_allclose(own.parameters[index], found, atol=1e-4)


@SERIOUS
@given(serial_chains(), st.integers(0, 2**32 - 1))
def test_mechanism_chain_that_can_be_inverted_comes_back_to_its_pose(elements, seed):
    """Wherever the inverse says that it has converged; near a singular place it need not."""
    machine = machine_of(elements)
    q = machine.home_q[:, None] + np.random.default_rng(seed).uniform(-0.2, 0.2, (6, 3))
    there = forward(machine, machine.extension(q))
    back = inverse(machine, task_values(machine.task, there.poses), start=there)
    again = forward(machine, back.extension, start=there)
    apart = pose_difference(there.poses, again.poses)[:, back.converged & again.converged]
    assert np.abs(apart[:3]).max(initial=0.0) < 1e-6
    assert np.abs(apart[3:]).max(initial=0.0) < 1e-9
