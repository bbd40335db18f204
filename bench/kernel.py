"""Compiled kinematics beside the numpy reference: batches, one pose alone, one identification.

Wanted on one core for the hexapod: in batches inverse <= 1 us, forward <= 4 us, Jacobian <= 2 us a
pose; one pose alone < 50 us inverse and < 100 us forward as a bare call, the public call at most
twice that; 29 poses identified in <= 3 ms; other machines within 3 times per unknown and loop.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # one core: before numpy is loaded

import time
from collections.abc import Callable

import numpy as np

from app.files.machines import load_machine, shipped_machines
from app.files.runs import read_run
from bench._hexapod_closed_form import HexapodClosedForm
from bench.identify import RUN, first_poses
from calib.arrays import Array
from calib.identify import fit
from calib.mechanism import kernel
from calib.mechanism.description import Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.solve import forward, home_configuration, inverse
from calib.model import Model
from calib.poses import sample_poses
from calib.runs.stack import stack

POSES = 1000
WORK = ("inverse", "forward", "Jacobian")


def best_of(work: Callable[[], object], repeats: int) -> float:
    """Least CPU time of a call, us: on a busy computer, too, it compares."""
    times = []
    for _ in range(repeats):
        began = time.thread_time()
        work()
        times.append(time.thread_time() - began)
    return 1e6 * min(times)


def old_and_new(work: Callable[[], object], repeats: int) -> tuple[float, float]:
    """Least CPU times, us: numpy, compiled; in turns, so that both meet the same caches."""
    work()
    old, new = [], []
    for _ in range(3):
        with kernel.reference():
            work()
            old.append(best_of(work, max(repeats // 10, 3)))
        new.append(best_of(work, repeats))
    return min(old), min(new)


def unknowns(machine: Machine) -> int:
    """What one pose solves for: the passive coordinates, and the pose or the extensions."""
    return len(machine.joints) + 6


def batches() -> None:
    """Every shipped machine, 1,000 poses from home."""
    print(f"{POSES} poses from home, us a pose: numpy, compiled, ratio; per unknown, hexapod = 1")
    rows = {}
    for name in ("hexapod", *(n for n in shipped_machines() if n != "hexapod")):
        machine = load_machine(name)
        poses = sample_poses(machine, POSES, np.random.default_rng(1))
        at = poses.configuration
        times = [
            old_and_new(work, 10)
            for work in (
                lambda m=machine, p=poses: inverse(m, p.task),
                lambda m=machine, e=at.extension: forward(m, e),
                lambda m=machine, a=at: pose_jacobians(m, a),
            )
        ]
        rows[name] = [new / POSES / unknowns(machine) for _, new in times]
        cells = [
            f"{what} {old / POSES:6.1f} {new / POSES:5.2f} {old / new:5.1f} ({per / first:3.1f})"
            for what, (old, new), per, first in zip(
                WORK, times, rows[name], rows["hexapod"], strict=True
            )
        ]
        print(f"{name:18s} {'   '.join(cells)}")


def peer() -> None:
    """The hexapod by hand in numpy, the same poses."""
    machine = load_machine("hexapod")
    at = sample_poses(machine, POSES, np.random.default_rng(1)).configuration
    hand = HexapodClosedForm(machine)
    answer = hand.forward(at.extension)
    ours = old_and_new(lambda: forward(machine, at.extension), 10)[1]
    derived = old_and_new(lambda: pose_jacobians(machine, at), 10)[1]
    theirs = best_of(lambda: hand.forward(at.extension), 10)
    differentiated = best_of(lambda: hand.jacobian(answer), 10)
    print(
        f"hexapod's closed form in numpy: forward {theirs / POSES:.1f} us, Jacobian "
        f"{differentiated / POSES:.1f} us a pose; compiled / closed form "
        f"{ours / theirs:.2f} and {derived / differentiated:.2f}"
    )


def bare_call(machine: Machine, asked: Array, is_forward: bool) -> Callable[[], None]:
    """The core alone on arrays that are there already, one pose."""
    compiled = kernel.kernel_of(machine)
    assert compiled is not None
    from calib.mechanism import _core  # there, as it is available

    home = compiled.place(home_configuration(machine))
    out = np.empty((sum(a.size for a in home) + 3, 1))
    extension, target = (asked, None) if is_forward else (None, asked)
    held = machine.nominal

    def call() -> None:
        _core.solve(compiled.machine, 1, held, extension, target, None, None, out, *home)

    return call


def alone() -> None:
    """One pose, from home."""
    print("one pose alone, us: numpy, compiled, ratio; bare call of the core, from home")
    for name in shipped_machines():
        machine = load_machine(name)
        poses = sample_poses(machine, 1, np.random.default_rng(2))
        extension, task = poses.configuration.extension.copy(), np.ascontiguousarray(poses.task)
        cells = []
        for what, work, bare in (
            ("inverse", lambda m=machine, t=task: inverse(m, t), bare_call(machine, task, False)),
            (
                "forward",
                lambda m=machine, e=extension: forward(m, e),
                bare_call(machine, extension, True),
            ),
        ):
            old, new = old_and_new(work, 100)
            cells.append(
                f"{what} {old:6.0f} {new:5.1f} {old / new:5.0f}, bare {best_of(bare, 1000):5.1f}"
            )
        print(f"{name:18s} {'   '.join(cells)}")


def identification() -> None:
    """The fit of a run, warm."""
    loaded = read_run(RUN)
    rows = stack(loaded.machine, [loaded.run])
    for poses in (29, 60):
        some = first_poses(rows, poses)
        old, new = old_and_new(lambda some=some: fit(Model(some)), 20)
        print(
            f"{poses} poses x 3 nests identified: numpy {old / 1e3:.1f} ms, compiled "
            f"{new / 1e3:.1f} ms, ratio {old / new:.1f}"
        )


def main() -> None:
    if not kernel.available():
        print("the compiled core was not built here: install again where a C compiler is")
        return
    print(f"core for {kernel.processor()}")
    batches()
    peer()
    alone()
    identification()


if __name__ == "__main__":
    main()
