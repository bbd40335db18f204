"""Cables that only pull: their forces balance the load, and one that would push is named."""

import numpy as np
import pytest

from calib.arrays import Array
from calib.discover.cables import slack_cables
from calib.errors import BadInput
from calib.identify import fit
from calib.mechanism.description import Machine
from calib.mechanism.parse import parse_machine
from calib.mechanism.solve import forward, inverse
from calib.model import Model
from calib.model.cables import cable_forces, has_cables
from calib.runs import parse_run
from calib.runs.stack import stack
from mocks.simulate.kinds import Laboratory
from tests.machines.test_machines_redundant import eight

COMPLIANCE = 1e-4
NESTS = {
    "a": np.array([80.0, 0.0, 30.0]),
    "b": np.array([-50.0, 70.0, 0.0]),
    "c": np.array([-40.0, -60.0, -20.0]),
}


@pytest.fixture(scope="module")
def machine() -> Machine:
    return parse_machine(eight(cables=True), "cables.toml")


def ways(machine: Machine, count: int) -> Array:
    low, high = np.array([machine.workspace[name] for name in machine.task.coordinates]).T
    unit = np.random.default_rng(4).random((6, count))
    return low[:, None] + (high - low)[:, None] * (0.2 + 0.6 * unit)


def pulls(machine: Machine, task: Array) -> tuple[Array, Array]:
    """Extensions (8, N) and wrenches (6, 8, N) on the platform per N, by plain geometry."""
    found = inverse(machine, task)
    columns = []
    for a, b, c in np.array(np.meshgrid(*[[-1, 1]] * 3)).reshape(3, -1).T:
        corner = np.array([-60.0 * a, 70.0 * b, 40.0 * c])
        arm = np.einsum("ijn,j->in", found.poses.rotation, corner)
        way = np.array([500.0 * a, 400.0 * b, 450.0 * (c + 1)])[:, None] - (
            found.poses.position + arm
        )
        along = way / np.linalg.norm(way, axis=0)
        columns.append(np.concatenate([along, np.cross(arm.T, along.T).T]))
    return found.extension, np.stack(columns, axis=1)


def taut(wrenches: Array, most: float) -> Array:
    """Tensions (8,) in balance with one another, the largest ``most``; least first."""
    null = np.linalg.svd(wrenches)[2][6:].T
    even = null @ (null.T @ np.ones(8))
    return np.asarray(most * even / even.max())


def test_ropes_that_pull_at_one_another_have_the_forces_of_their_shortening(
    machine: Machine,
) -> None:
    extension, wrenches = pulls(machine, ways(machine, 5))
    assert has_cables(machine)
    for n in range(5):
        tension = taut(wrenches[:, :, n], 120.0)
        closed = forward(machine, extension[:, [n]] - COMPLIANCE * tension[:, None])
        none = np.zeros((3, 1))
        got = cable_forces(machine, closed, machine.nominal, none, none)
        assert got.names == tuple(f"leg{k}" for k in range(1, 9))
        assert got.force[:, 0] == pytest.approx(tension, abs=0.02)


def test_forces_of_ropes_balance_the_load(machine: Machine) -> None:
    extension, wrenches = pulls(machine, ways(machine, 5))
    rng = np.random.default_rng(6)
    force, moment = 80.0 * rng.standard_normal((3, 5)), 500.0 * rng.standard_normal((3, 5))
    closed = forward(machine, extension)
    got = cable_forces(machine, closed, machine.nominal, force, moment)
    balance = np.einsum("ikn,kn->in", wrenches, got.force) + np.concatenate([force, moment])
    assert np.abs(balance[:3]).max() < 1e-6
    assert np.abs(balance[3:]).max() < 1e-4


def run_of(machine: Machine, tension: float, slack: int | None) -> object:
    """Twelve poses, ropes taut by so many N; in two of them one rope is much too long."""
    extension, wrenches = pulls(machine, ways(machine, 12))
    q = np.array(extension)
    for n in range(12):
        q[:, n] -= COMPLIANCE * taut(wrenches[:, :, n], tension)
        if slack is not None and n < 2:
            q[slack, n] += 0.3
    at = forward(machine, q).poses
    header = {
        "machine": "cables",
        "nests": {"platform": {k: v.tolist() for k, v in NESTS.items()}, "base": {}},
        "instruments": {"tracker": {"frame": "base"}},
    }
    lab = Laboratory(header, NESTS, {}, 8, np.random.default_rng(1))
    for n in range(12):
        told = machine.coordinates(q[:, [n]])[:, 0]
        lab.go(f"p{n}", told.tolist(), at.position[:, n], at.rotation[:, :, n])
        for nest in NESTS:
            lab.point(nest, 0.002, by="tracker")
    return parse_run(*lab.texts(), actuators=8)


def test_a_cable_that_would_push_is_named_with_its_poses(machine: Machine) -> None:
    # What is found of the zeros may stretch or slacken all: little is left to find here.
    text = eight(cables=True).replace("tolerance = 0.5", "tolerance = 0.0005")
    known = parse_machine(text, "cables.toml")
    for slack, said in ((None, ""), (2, "leg3 at 2")):
        found = fit(Model(stack(known, [run_of(machine, 400.0, slack)])))
        words = slack_cables(found)
        assert (said in words) if said else words == ""
        if said:
            assert "at pose p" in words
            assert "weight is not counted: run.toml has no [load]" in words


def test_a_rope_is_a_spring_along_the_chain() -> None:
    text = eight(cables=True).replace('pulls = "rope"', 'pulls = "L0"', 1)
    with pytest.raises(BadInput, match="is no spring"):
        parse_machine(text, "cables.toml")
