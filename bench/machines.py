"""Forward kinematics and error Jacobian of every shipped machine, in batches of 1,000 poses.

Wanted: the ptm's 6 x 83 error Jacobian over its 217 poses in less than 8 ms. One core.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # one core: before numpy is loaded

import time
from collections.abc import Callable

import numpy as np

from app.files.machines import load_machine, shipped_machines
from calib.analysis.coverage import workspace_poses
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.solve import forward, inverse
from calib.poses import sample_poses

POSES, REPEATS = 1000, 5


def best_of(work: Callable[[], object]) -> float:
    """Shortest time of a call, s."""
    times = []
    for _ in range(REPEATS):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return min(times)


def main() -> None:
    print(
        f"{'machine':18s} {'forward':>9s} {'inverse':>9s} {'Jacobian':>9s}   us a pose, from home"
    )
    for name in shipped_machines():
        machine = load_machine(name)
        poses = sample_poses(machine, POSES, np.random.default_rng(1))
        extension = poses.configuration.extension
        columns = [
            best_of(lambda m=machine, e=extension: forward(m, e)),
            best_of(lambda m=machine, p=poses: inverse(m, p.task)),
            best_of(lambda m=machine, p=poses: pose_jacobians(m, p.configuration)),
        ]
        cells = " ".join(f"{1e6 * t / POSES:9.1f}" for t in columns)
        shape = f"{len(machine.limbs)} limbs, 6 x {len(machine.parameters)}"
        print(f"{name:18s} {cells}   {shape}")
    machine = load_machine("ptm")
    grid = workspace_poses(machine, 1, np.random.default_rng(1))
    took = best_of(lambda: pose_jacobians(machine, grid.configuration))
    print(f"ptm, error Jacobian over {grid.count} poses: {1e3 * took:.1f} ms (want < 8)")


if __name__ == "__main__":
    main()
