"""A short way through the poses, and a look at the whole of it before the first move.

The drives move together, so the time of a move is that of the actuator with the largest part of
its stroke to go: that is the distance here. The controller interpolates actuators linearly.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, IntArray
from calib.mechanism.description import Machine
from calib.mechanism.limits import Margin, Violation, kept_at, violations
from calib.mechanism.solve import forward, home_configuration

SWEEPS = 50
"""Sweeps of 2-opt; it ends by itself long before."""
STEP = 0.04
"""Largest part of a stroke between two points at which the path is looked at."""


@dataclass(frozen=True)
class PathFault:
    """A limit that is passed between two stops (0 is home, k the k-th pose)."""

    start: int
    end: int
    violation: Violation


def _strokes(machine: Machine) -> Array:
    low, high = machine.q_limits.T
    stroke: Array = high - low
    return stroke


def distances(machine: Machine, q: Array) -> Array:
    """Distance (N, N) between actuator coordinates q (n, N): largest part of a stroke."""
    scaled = q / _strokes(machine)[:, None]
    apart: Array = np.max(np.abs(scaled[:, :, None] - scaled[:, None, :]), axis=0)
    return apart


def short_order(machine: Machine, q: Array) -> IntArray:
    """Order (N,) in which to visit q (n, N), from home and back: nearest neighbour, then 2-opt."""
    D = distances(machine, np.column_stack([machine.home_q, q]))
    count = len(D)
    tour, left = [0], set(range(1, count))
    while left:
        nearest = min(left, key=lambda k: (D[tour[-1], k], k))
        tour.append(nearest)
        left.remove(nearest)
    order = np.array(tour)
    for _ in range(SWEEPS):
        if not _two_opt_sweep(order, D):
            break
    return order[1:] - 1


def _two_opt_sweep(order: IntArray, D: Array) -> bool:
    """Turn round the stretch that helps most at each place; whether any did."""
    better, count = False, len(order)
    for i in range(1, count - 1):
        after = np.roll(order, -1)
        j = np.arange(i + 1, count)
        before, here = order[i - 1], order[i]
        saved = D[before, here] + D[order[j], after[j]] - D[before, order[j]] - D[here, after[j]]
        best = int(np.argmax(saved))
        if saved[best] > 1e-12:
            end = j[best] + 1
            order[i:end] = order[i:end][::-1].copy()
            better = True
    return better


def path_length(machine: Machine, q: Array) -> float:
    """Length of the way home - q (n, N) in its order - home, in strokes of the slowest actuator."""
    stops = np.column_stack([machine.home_q, q, machine.home_q]) / _strokes(machine)[:, None]
    return float(np.sum(np.max(np.abs(np.diff(stops, axis=1)), axis=0)))


def check_path(machine: Machine, q: Array, margin: Margin | None = None) -> list[PathFault]:
    """Look at the whole way home - q (n, N) - home; every limit that it passes.

    The nominal machine is followed along straight lines in actuator space; a place where it does
    not close counts like a limit. ``margin`` is kept free of the limits, as far as home does.
    """
    stops = np.column_stack([machine.home_q, q, machine.home_q])
    parts = np.max(np.abs(np.diff(stops, axis=1)) / _strokes(machine)[:, None], axis=0)
    counts = np.maximum(np.ceil(parts / STEP).astype(int), 1)
    leg = np.repeat(np.arange(len(counts)), counts)
    share = np.concatenate([np.arange(1, n + 1) / n for n in counts])
    along = stops[:, leg] + share * (stops[:, leg + 1] - stops[:, leg])
    home = home_configuration(machine)
    configuration = forward(machine, machine.extension(along), start=home)
    kept = None if margin is None else kept_at(machine, home, margin)
    last = stops.shape[1] - 1
    return [
        PathFault(int(leg[v.pose]), int(leg[v.pose] + 1) % last, v)
        for v in violations(machine, configuration, margin=kept)
    ]
