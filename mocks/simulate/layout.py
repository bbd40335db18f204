"""Who measures what when: the rows of a campaign, before anything is measured."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mocks.physics.body import Surroundings
from mocks.physics.pose import Array
from mocks.simulate.plan import RunPlan

HOME = -1
FIRST_S, MOVE_S, NEXT_NEST_S, BASE_BEFORE_S = 10.0, 10.0, 4.0, 4.0


@dataclass(frozen=True)
class Layout:
    """R rows in the order of the run.

    ``pose`` (R,) index of the commanded pose, -1 = home; ``nest`` names, "" for a move without a
    reading; ``labelled`` (R,) whether the row carries its pose's label; ``time`` (R,) s;
    ``cycle`` (R,) number of the visit, from 1 (0 where there is none).
    """

    pose: NDArray[np.intp]
    nest: tuple[str, ...]
    labelled: NDArray[np.bool_]
    time: Array
    cycle: NDArray[np.intp]

    @property
    def reading(self) -> NDArray[np.bool_]:
        """Rows that are readings, (R,)."""
        return np.array([bool(name) for name in self.nest])


def arrange(plan: RunPlan, poses: int, around: Surroundings) -> Layout:
    """Rows of a campaign: home, base nests, poses and nests with base nests between, base nests."""
    nests_used = plan.nests or tuple(around.platform_nests)
    if plan.order == "nest-by-nest":
        visits = [(p, n, c) for n in nests_used for c in range(plan.cycles) for p in range(poses)]
    else:
        visits = [(p, n, c) for c in range(plan.cycles) for p in range(poses) for n in nests_used]
    rows: list[tuple[int, str, bool, float, int]] = [(HOME, "", True, 0.0, 0)]
    time, before = FIRST_S - MOVE_S, HOME

    def base_nests(pose: int, at: float) -> None:
        rows.extend((pose, nest, False, at, 0) for nest in around.base_nests)

    for count, (pose, nest, cycle) in enumerate(visits):
        time += NEXT_NEST_S if pose == before else MOVE_S
        if count % plan.base_every == 0:
            base_nests(pose if count else HOME, time - BASE_BEFORE_S)
        rows.append((pose, nest, True, time, cycle + 1))
        before = pose
    base_nests(before, time + NEXT_NEST_S)
    pose_index, nests, labelled, times, cycles = zip(*rows, strict=True)
    return Layout(
        pose=np.array(pose_index),
        nest=tuple(nests),
        labelled=np.array(labelled),
        time=np.array(times, dtype=float),
        cycle=np.array(cycles),
    )
