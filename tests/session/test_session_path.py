"""No way is gone on which the machine leaves its limits, whatever lies at its ends."""

from dataclasses import replace

import numpy as np
import pytest

from app.errors import GateRefused
from app.files.machines import load_machine
from app.session.path import BETWEEN, check_waypoints
from calib.arrays import Array
from calib.mechanism.description import Machine
from calib.mechanism.limits import violations
from calib.mechanism.rigid import Poses
from calib.mechanism.solve import forward, inverse

LABELS = ["home", "there"]


def poses_at(machine: Machine, q: Array) -> list[Array]:
    found = forward(machine, machine.extension(q))
    assert found.converged.all()
    return list(found.poses.to_xyz_rpy().T)


def along(machine: Machine, path: list[Array], share: Array):
    """Configurations on the way, straight for the actuators."""
    ends = inverse(machine, Poses.from_xyz_rpy(np.array(path).T)).extension
    return forward(machine, ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * share)


def limited(machine: Machine, joint: int, high: float) -> Machine:
    """The same machine, one joint of which turns no further."""
    limbs, at = [], 0
    for limb in machine.limbs:
        joints = []
        for one in limb.joints:
            low = min(one.limits[0], high - 10.0)
            joints.append(replace(one, limits=(low, high)) if at == joint else one)
            at += 1
        limbs.append(replace(limb, joints=tuple(joints)))
    return replace(machine, limbs=tuple(limbs))


def bent_way(machine: Machine) -> tuple[list[Array], int, Array]:
    """A way on which some joint turns farther between two places that are looked at than at them;
    its ends, the joint, and how far it turns at 8 * 64 places."""
    rng = np.random.default_rng(2)
    low, high = machine.q_limits.T
    fine = np.linspace(0.0, 1.0, 8 * 64 + 1)
    for _ in range(100):
        q = low[:, None] + (high - low)[:, None] * rng.uniform(0.1, 0.9, (len(low), 2))
        found = forward(machine, machine.extension(q))
        if not found.converged.all():
            continue
        path = list(found.poses.to_xyz_rpy().T)
        turns = along(machine, path, fine).passive
        coarse = turns[:, :: 512 // BETWEEN]
        over = turns.max(axis=1) - coarse.max(axis=1)
        if over.max() > 1e-4:
            joint = int(np.argmax(over))
            return path, joint, turns[joint]
    raise AssertionError("no such way")


def test_a_joint_that_passes_its_limit_between_two_places_is_seen() -> None:
    machine = load_machine("hexapod")
    path, joint, turns = bent_way(machine)
    top, seen = float(turns.max()), float(turns[:: 512 // BETWEEN].max())
    narrow = limited(machine, joint, 0.5 * (top + seen))
    assert not list(violations(narrow, along(narrow, path, np.array([0.0, 1.0]))))
    with pytest.raises(GateRefused, match="the way from pose home to pose there"):
        check_waypoints(narrow, {}, path, LABELS)
    wide = limited(machine, joint, top + 1e-3)
    assert check_waypoints(wide, {}, path, LABELS) > 0.0


@pytest.mark.parametrize("name", ["hexapod", "delta", "stewart"])
def test_whatever_is_gone_stays_within_every_limit(name: str) -> None:
    """Random machines within tolerance, random ends, joints as narrow as half of what they use."""
    machine, rng = load_machine(name), np.random.default_rng(7)
    low, high = machine.q_limits.T
    gone = refused = 0
    for _ in range(9):
        parameters = machine.nominal + machine.prior_sigma * rng.standard_normal(
            machine.nominal.size
        )
        named = {p.name: float(v) for p, v in zip(machine.parameters, parameters, strict=True)}
        q = low[:, None] + (high - low)[:, None] * rng.uniform(0.02, 0.98, (len(low), 2))
        found = forward(machine, machine.extension(q, named), parameters)
        if not found.converged.all():
            continue
        tight = machine
        for joint, reach in enumerate(found.passive.max(axis=1)):
            tight = limited(tight, joint, float(reach) + 0.002 * float(rng.uniform(0.1, 2.0)))
        path = list(found.poses.to_xyz_rpy().T)
        try:
            check_waypoints(tight, named, path, LABELS)
        except GateRefused:
            refused += 1
            continue
        gone += 1
        ends = inverse(tight, Poses.from_xyz_rpy(np.array(path).T), parameters).extension
        share = np.linspace(0.0, 1.0, 301)
        way = forward(tight, ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * share, parameters)
        assert not list(violations(tight, way, named))
    assert gone + refused >= 5
