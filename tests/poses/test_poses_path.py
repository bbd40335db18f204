import itertools

import numpy as np

from app.files.machines import load_machine
from calib.poses import sample_poses
from calib.poses.path import check_path, distances, path_length, short_order


def test_order_is_a_permutation_and_short() -> None:
    machine = load_machine("hexapod")
    q = sample_poses(machine, 40, np.random.default_rng(4)).q
    order = short_order(machine, q)
    assert sorted(order) == list(range(40))
    assert path_length(machine, q[:, order]) < 0.75 * path_length(machine, q)


def test_few_poses_are_ordered_nearly_as_well_as_by_trying_all_orders() -> None:
    machine = load_machine("hexapod")
    for seed in range(5):
        q = sample_poses(machine, 6, np.random.default_rng(seed)).q
        found = path_length(machine, q[:, short_order(machine, q)])
        best = min(
            path_length(machine, q[:, p]) for p in map(list, itertools.permutations(range(6)))
        )
        assert best - 1e-12 <= found < 1.1 * best


def test_distance_is_the_slowest_actuators_part_of_its_stroke() -> None:
    machine = load_machine("hexapod")
    q = np.repeat(machine.home_q[:, None], 2, axis=1)
    q[0, 1] += 7.0
    q[3, 1] -= 35.0
    assert distances(machine, q)[0, 1] == 0.5


def test_a_path_beyond_the_stroke_is_named() -> None:
    machine = load_machine("hexapod")
    inside = sample_poses(machine, 3, np.random.default_rng(9)).q
    assert check_path(machine, inside) == []
    outside = inside.copy()
    outside[2, 1] = 268.0
    faults = check_path(machine, outside)
    assert {(fault.start, fault.end) for fault in faults} == {(1, 2), (2, 3)}
    assert all(fault.violation.what == "q3" for fault in faults)
