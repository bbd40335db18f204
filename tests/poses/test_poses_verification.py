import numpy as np
import pytest

from app.files.machines import load_machine, shipped_machines
from calib.mechanism.limits import within_limits
from calib.mechanism.solve import forward
from calib.poses import verification_poses


@pytest.mark.long
@pytest.mark.parametrize("name", shipped_machines())
def test_every_verification_pose_is_within_limits(name: str) -> None:
    grid = verification_poses(load_machine(name))
    assert np.all(within_limits(grid.pose_set.machine, grid.pose_set.configuration))
    assert len(set(grid.labels)) == len(grid.labels) == grid.poses.count


def test_hexapod_grid_is_27_nodes_by_8_orientations() -> None:
    machine = load_machine("hexapod")
    grid = verification_poses(machine)
    assert grid.poses.count == 216
    nodes = {tuple(column) for column in np.round(grid.poses.position.T, 6)}
    assert len(nodes) == 27
    turns = {tuple(column) for column in np.round(grid.pose_set.task[3:].T, 9)}
    assert len(turns) == 8
    # As large as can be, with 1.4 mm of each stroke spared for a calibrated machine's other q.
    assert 0.3 < grid.scale < 0.5
    q = grid.pose_set.q
    assert 1.4 <= min(q.min() - 195.0, 265.0 - q.max()) < 1.9


def test_the_grid_closes_forward_where_it_was_asked() -> None:
    grid = verification_poses(load_machine("hexapod"))
    back = forward(grid.pose_set.machine, grid.pose_set.configuration.extension)
    assert np.max(np.abs(back.poses.position - grid.poses.position)) < 1e-9
    assert list(grid.by_label) == list(grid.labels)
