"""The compiled core and the arrays of numpy are one engine: on every machine, number by number."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from calib.arrays import Array, BoolArray
from calib.errors import BadInput
from calib.mechanism import kernel
from calib.mechanism.closure import Closure
from calib.mechanism.compiled import compile_machine
from calib.mechanism.configuration import Configuration
from calib.mechanism.description import Machine
from calib.mechanism.jacobian import element_twists, pose_jacobians
from calib.mechanism.limits import violations
from calib.mechanism.parse import parse_machine
from calib.mechanism.rigid import Poses, exponential, pose_difference, product
from calib.mechanism.solve import forward, inverse
from calib.mechanism.sweep import Standing
from calib.mechanism.task import task_values
from calib.mechanism.variants import with_closure
from tests.machines.made_machines import gantry, screw_delta
from tests.machines.test_machines_redundant import SEVEN, eight
from tests.mechanism.conftest import load, manufactured, reachable
from tests.mechanism.test_mechanism_laws import SHIPPED

if not kernel.available():
    pytest.skip("the compiled core was not built: no C compiler here", allow_module_level=True)

from calib.mechanism import _core

POSES = 33
"""No multiple of the number of poses that the core takes together."""
MADE = {
    "gantry": gantry,
    "screw-delta": screw_delta,
    "seven axes": lambda: parse_machine(SEVEN, "seven"),
    "eight legs": lambda: parse_machine(eight(), "eight"),
    "tripod, detailed": lambda: load("tripod").detailed,
    "ptm, one limb released": lambda: with_closure(load("ptm"), "D3"),
}


@pytest.fixture(scope="module", params=[*SHIPPED, *MADE])
def machine(request: pytest.FixtureRequest) -> Machine:
    return MADE[request.param]() if request.param in MADE else load(request.param)


@pytest.fixture(scope="module")
def configuration(machine: Machine) -> Configuration:
    return reachable(machine, POSES, seed=1)


def both(function, *arguments, **named):
    """What numpy answers, and what the core does."""
    with kernel.reference():
        expected = function(*arguments, **named)
    return expected, function(*arguments, **named)


def close(a: Array, b: Array, relative: float = 1e-12) -> None:
    assert a.shape == b.shape
    assert np.abs(a - b).max(initial=0.0) <= relative * np.abs(b).max(initial=0.0)


def agree(machine: Machine, expected: Configuration, found: Configuration) -> None:
    """The same poses close, at the same places to 1e-12 times their condition."""
    closed = expected.converged
    assert np.array_equal(found.converged, closed)
    a, b = expected.take(closed), found.take(closed)
    allowed = 1e-12 / a.conditioning
    size = machine.size
    units = np.array([1.0 if joint.turns else size for joint in machine.joints])[:, None]
    apart = pose_difference(a.poses, b.poses)
    assert np.all(np.abs(apart[:3]) <= allowed * size)
    assert np.all(np.abs(apart[3:]) <= allowed)
    assert np.all(np.abs(a.passive - b.passive) <= allowed * units)
    assert np.all(np.abs(a.extension - b.extension) <= allowed * size)
    for mine, theirs in zip(a.strain, b.strain, strict=True):
        assert np.all(np.abs(mine - theirs) <= allowed * size)
    assert b.conditioning == pytest.approx(a.conditioning, rel=1e-3)


def disturbed(at: Configuration, seed: int) -> Configuration:
    """Not closed any more: every coordinate moved by some thousandths."""
    rng = np.random.default_rng(seed)

    def moved(a: Array) -> Array:
        return a + 1e-3 * rng.standard_normal(a.shape)

    turned = product(exponential(1e-3 * rng.standard_normal((3, at.count))), at.poses.rotation)
    poses = Poses(moved(at.poses.position), turned)
    strain = tuple(moved(s) for s in at.strain)
    return replace(at, poses=poses, passive=moved(at.passive), strain=strain)


def test_rows_and_gaps_of_open_limbs_agree(machine: Machine, configuration: Configuration) -> None:
    at, held = disturbed(configuration, seed=2), manufactured(machine, seed=3)[:, None]
    closure = Closure(machine, held, at.extension, Standing.of(at))
    expected_rows, expected_gaps = closure.rows()
    found_rows, found_gaps = kernel.kernel_of(machine).rows(held, at)
    order, row = {}, 0
    for group in compile_machine(machine).groups:  # row by row, limb after limb in each
        for own in range(group.rows):
            for limb in group.limbs:
                order[limb, own], row = row, row + 1
    numpy_row = [order[key] for key in sorted(order)]
    close(found_rows, expected_rows[numpy_row])
    close(found_gaps, expected_gaps[numpy_row])


def test_jacobians_agree(machine: Machine, configuration: Configuration) -> None:
    each = np.stack([manufactured(machine, seed) for seed in range(POSES)], axis=1)
    at = forward(machine, configuration.extension, each, start=configuration)
    for held in (each, each[:, 0]):
        expected, found = both(pose_jacobians, machine, at, held)
        close(found.parameters, expected.parameters)
        close(found.actuators, expected.actuators)
    places = [(i, k) for i, limb in enumerate(machine.limbs) for k in range(len(limb.elements))]
    close(*both(element_twists, machine, at, each, places[::3])[::-1])


def test_solved_poses_agree(machine: Machine, configuration: Configuration) -> None:
    built = manufactured(machine, seed=4)
    each = np.stack([manufactured(machine, seed) for seed in range(POSES)], axis=1)
    extension = configuration.extension
    target = task_values(machine.task, configuration.poses)
    agree(machine, *both(forward, machine, extension, each))
    agree(machine, *both(forward, machine, extension, built, start=configuration))
    agree(machine, *both(inverse, machine, target, each))
    agree(machine, *both(inverse, machine, configuration.poses, built, start=configuration))


def test_the_same_poses_do_not_close(machine: Machine) -> None:
    """Outside of the workspace and of the strokes, or no number at all.

    What wanders for more than 20 steps may end anywhere: there rounding decides.
    """
    rng = np.random.default_rng(6)
    low, high = np.array([machine.workspace[c] for c in machine.task.coordinates]).T
    spread = rng.uniform(-1.0, 1.0, (len(low), POSES))
    target = (0.5 * (low + high))[:, None] + (high - low)[:, None] * spread
    target[0, 5] = np.nan
    expected, found = both(inverse, machine, target)
    settled = _settled(expected) | _settled(found)
    agree(machine, expected.take(settled), found.take(settled))
    assert np.count_nonzero(settled) >= 3
    assert not found.converged[5]
    expected, found = expected.take(settled), found.take(settled)
    assert [(v.pose, v.what) for v in violations(machine, found)] == [
        (v.pose, v.what) for v in violations(machine, expected)
    ]
    low, high = machine.q_limits.T
    spread = rng.uniform(-1.2, 1.2, (len(low), POSES))
    extension = machine.extension((0.5 * (low + high))[:, None] + (high - low)[:, None] * spread)
    extension[0, 7] = np.inf
    expected, found = both(forward, machine, extension)
    settled = _settled(expected) | _settled(found)
    assert np.all(found.converged & expected.converged | ~settled)
    assert not found.converged[7]


def _settled(found: Configuration) -> BoolArray:
    closed: BoolArray = found.converged & (found.iterations <= 20)
    return closed


def test_a_pose_is_solved_alone_as_among_others(
    machine: Machine, configuration: Configuration
) -> None:
    together = forward(machine, configuration.extension)
    for k in (0, 3, POSES - 1):
        agree(machine, together.take([k]), forward(machine, configuration.extension[:, [k]]))


def test_all_processors_agree(machine: Machine, configuration: Configuration) -> None:
    found = []
    for name in ("plain", "avx2"):
        before = _core.processor()
        try:
            _core.choose(name)
        except ValueError as missing:
            pytest.skip(str(missing))
        closed = forward(machine, configuration.extension, manufactured(machine, seed=5))
        found.append((closed, pose_jacobians(machine, closed)))
        _core.choose(before)
    (one, its), (other, theirs) = found
    agree(machine, one, other)
    close(its.parameters, theirs.parameters)


def test_no_poses_are_no_poses(hexapod: Machine) -> None:
    found = forward(hexapod, np.empty((6, 0)))
    assert found.count == 0
    assert pose_jacobians(hexapod, found).parameters.shape == (54, 6, 0)


def test_no_elements_have_no_twists(hexapod: Machine) -> None:
    closed = forward(hexapod, np.zeros((6, 5)))
    assert element_twists(hexapod, closed, None, []).shape == (0, 6, 5)


def test_a_platform_that_nothing_holds_is_refused_in_the_same_words(hexapod: Machine) -> None:
    loose = replace(hexapod, limbs=hexapod.limbs[:5])
    with pytest.raises(BadInput, match="constrain 5 of 6 freedoms"):
        forward(loose, np.zeros((6, 1)))


def test_complex_numbers_are_left_to_numpy(hexapod: Machine) -> None:
    assert kernel.kernel_of(hexapod, np.zeros(1)) is not None
    assert kernel.kernel_of(hexapod, np.zeros(1, dtype=complex)) is None


def test_arrays_that_do_not_go_together_are_refused(hexapod: Machine) -> None:
    tables = kernel.kernel_of(hexapod).machine
    held, extension, out = hexapod.nominal, np.zeros((6, 2)), np.empty((51, 2))
    home = (np.zeros((3, 1)), np.zeros((9, 1)), np.zeros((30, 1)), np.zeros((6, 1)), np.empty(0))
    for arguments in (
        (tables, 2, held[:-1], extension, None, None, None, out, *home),
        (tables, 3, held, extension, None, None, None, out, *home),
        (tables, 2, held, extension, None, None, None, out[:-1], *home),
        (tables, 2, held, extension, None, None, np.zeros(5), out, None),
        (tables, 2, held, extension, extension, None, None, out, *home),
        (tables, 2, held, None, None, None, None, out, *home),
        (tables, 2, held, extension, None, None, None, out, None),
        (tables, -1, held, extension, None, None, None, out, *home),
        (tables, 2, held, extension, None, None, None, out, *home[:4], np.empty(3)),
    ):
        with pytest.raises(ValueError):
            _core.solve(*arguments)
    for arguments in (
        (tables, 2, held, extension.astype(np.float32), None, None, None, out, *home),
        (tables, 2, held, [[0.0] * 2] * 6, None, None, None, out, *home),
        (tables, 2, held, extension),
    ):
        with pytest.raises(TypeError):
            _core.solve(*arguments)
    with pytest.raises(ValueError):
        _core.prepare(np.zeros(12, dtype=np.intc), np.zeros(1))
    closed = forward(hexapod, extension)
    with pytest.raises(IndexError):
        element_twists(hexapod, closed, None, [(6, 0)])


def test_a_process_can_go_without_it_and_says_so() -> None:
    for wish, answer in (
        ("off", "numpy, slower: PKMCAL_COMPILED=off"),
        ("on", "the compiled core"),
    ):
        done = subprocess.run(
            [sys.executable, "-m", "pkmcal", "--version"],
            env={**os.environ, "PKMCAL_COMPILED": wish},
            capture_output=True,
            text=True,
            check=True,
        )
        assert f"kinematics by {answer}" in done.stdout
