"""Labels of poses: one label for two poses, and labels in the order of the alphabet."""

from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.look.order import order_of_rows
from calib.mechanism.description import Machine
from calib.runs.record import Run
from calib.runs.remark import Remark, ranges

APART = 0.01
"""Part of an actuator's travel by which commands of one pose may differ."""
LEAST_SORTED = 12
"""Fewest poses whose order tells that the rows were sorted."""


def pose_labels(machine: Machine, run: Run) -> tuple[Run, list[Remark]]:
    """Make two poses of a label that stands for two; say if rows were sorted by their labels."""
    run, shared = _shared(machine, run)
    return run, [*shared, *(_sorted_rows(run) or order_of_rows(run))]


def shared_labels(machine: Machine, run: Run) -> dict[str, int]:
    """Labels that stand for more than one command, each with the line that shows it."""
    return _poses_apart(machine, run)[1]


def _poses_apart(machine: Machine, run: Run) -> tuple[list[str], dict[str, int], list[int]]:
    """Names of poses that are poses of their own, the labels that they share, and their lines."""
    travel = np.ptp(machine.q_limits, axis=1)
    travel = np.where(np.isfinite(travel), travel, np.inf)[:, None]
    names: list[str] = list(run.pose)
    lines: list[int] = []
    shared: dict[str, int] = {}
    kinds: dict[str, list[Array]] = {}
    for row, label in enumerate(run.pose):
        if not label or run.nest[row] not in run.header.platform_nests or not run.measured[row]:
            continue
        known = kinds.setdefault(label, [])
        q = run.q[:, [row]]
        near = [k for k, other in enumerate(known) if np.all(np.abs(q - other) < APART * travel)]
        if not near:
            known.append(q)
            near = [len(known) - 1]
        if near[0] > 0:
            names[row] = f"{label} ({near[0] + 1})"
            lines.append(int(run.line[row]))
            shared.setdefault(label, int(run.line[row]))
    return names, shared, lines


def _shared(machine: Machine, run: Run) -> tuple[Run, list[Remark]]:
    names, shared, lines = _poses_apart(machine, run)
    if not shared:
        return run, []
    named = ", ".join(list(shared)[:4]) + (" ..." if len(shared) > 4 else "")
    remark = Remark(
        "pose-label-shared",
        f"{'Label' if len(shared) == 1 else 'Labels'} {named} "
        f"{'stands' if len(shared) == 1 else 'stand'} for two different poses",
        ranges(lines, run.line[run.measured]),
        f"From line {min(shared.values())} on the actuators are commanded elsewhere under the "
        "same label",
        "Taken as poses of their own",
        "Give every commanded pose a label of its own",
        True,
        run.source,
    )
    return replace(run, pose=tuple(names)), [remark]


def _sorted_rows(run: Run) -> list[Remark]:
    """Rows in the order of the alphabet: nobody visits 1, 10, 11, 2."""
    labels = [
        run.pose[row]
        for row in np.flatnonzero(run.measured)
        if run.pose[row] and run.nest[row] in run.header.platform_nests
    ]
    visited = list(dict.fromkeys(labels))
    try:
        numbers = [int(label) for label in visited]
    except ValueError:
        return []
    if len(visited) < LEAST_SORTED or visited != sorted(visited) or numbers == sorted(numbers):
        return []
    return [
        Remark(
            "rows-sorted",
            "The rows are sorted by the text of the pose labels: their order is not that of "
            "measuring",
            (),
            f"Poses come as {', '.join(visited[:4])}: no machine visits them so",
            "Taken as it stands; what depends on order, direction of approach or time means "
            "nothing here",
            "Write the rows in the order in which they were measured",
            False,
            run.source,
        )
    ]
