"""Actuators relax after every move: extension_i(t) = -k sum of step_ij exp(-(t - t_j) / tau).

The sum is over all changes j of actuator i since the run began, each at the time of its row. What
is left of the last one alone, within seconds, is ``settling``.
"""

from collections.abc import Iterator

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation
from calib.effects.fading import time_constant
from calib.runs.commanded import CommandedPath
from calib.runs.stack import Rows
from calib.unknown import Unknown

SHORTEST_S, LONGEST_S = 60.0, 3600.0
TRIALS = 16


class Creep(Effect):
    """One fraction and one time constant for all actuators."""

    id = "creep"
    kind = "machine"
    says = "every leg or drive relaxes for minutes after each move: what moved before still shows"
    depends = ("path", "time_s")

    def unavailable(self, rows: Rows) -> str:
        """Without moves, or without times, there is nothing to look back on."""
        if not np.any(rows.step[:, rows.on_platform]):
            return "no row follows a move"
        return "" if np.ptp(rows.path.time_s) > 0.0 else "no time passes in the run (time_s)"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``creep.k``, a ratio, and ``creep.tau`` in s."""
        return (Unknown("creep.k", "1", 1e-3), Unknown("creep.tau", "s", 600.0, nonlinear=True))

    def trials(self, rows: Rows) -> Iterator[tuple[float, ...]]:
        """From a minute to an hour, in equal ratios."""
        for tau in np.geomspace(SHORTEST_S, LONGEST_S, TRIALS):
            yield (float(tau),)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """What is left of all changes, against them; and its derivative by tau."""
        path, at = situation.rows.path, situation.rows.at
        share, tau = float(values[0]), time_constant(values[1])
        left, by_age = left_of_changes(path, tau)
        slope = share * by_age[:, at] / tau**2
        return Signature(extension=-np.stack([left[:, at], slope]))


def left_of_changes(path: CommandedPath, tau: float) -> tuple[Array, Array]:
    """Sum of all changes up to each row, faded; and the sum of each times its age, (n, M) both.

    Rows look back 1, 2, 4 ... rows: log2 M steps over the whole path, whose rows may branch.
    """
    left, back = path.change.copy(), path.before
    by_age = np.zeros_like(left)
    while np.any(back >= 0):
        there = back >= 0
        age = np.where(there, path.time_s - path.time_s[back], 0.0)
        faded = np.where(there, np.exp(-age / tau), 0.0)
        by_age = by_age + faded * (by_age[:, back] + age * left[:, back])
        left = left + faded * left[:, back]
        back = np.where(there, back[back], -1)
    return left, by_age


EFFECTS = (Creep(),)
