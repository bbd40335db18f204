"""The machine still creeps when the dwell begins: k (last step of s_i) exp(-delay / tau).

Without a column ``delay_s`` only the product k exp(-delay / tau) is known; it is then called k.
"""

from collections.abc import Iterator

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation
from calib.effects.fading import time_constant
from calib.runs.stack import Rows
from calib.unknown import Unknown


class Settling(Effect):
    """One fraction and one time constant for all actuators."""

    id = "settling"
    kind = "machine"
    says = "the machine still creeps towards its target when the dwell begins"
    depends = ("step", "delay_s")

    def unavailable(self, rows: Rows) -> str:
        """Without a step before it, no reading can show creep."""
        return "" if np.any(rows.step[:, rows.on_platform]) else "no row follows a move"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``settling.k``, and ``settling.tau`` in s where delays are known and differ."""
        share = Unknown("settling.k", "1", 1e-3)
        if not _delays_differ(rows):
            return (share,)
        return (share, Unknown("settling.tau", "s", 1.0, nonlinear=True))

    def trials(self, rows: Rows) -> Iterator[tuple[float, ...]]:
        """Time constants from a tenth of the shortest to ten times the longest delay."""
        if not _delays_differ(rows):
            yield ()
            return
        delays = _delays(rows)
        low = max(0.1 * float(delays[delays > 0].min(initial=1.0)), 0.02 * float(delays.max()))
        for tau in np.geomspace(low, 10.0 * float(delays.max()), 24):
            yield (float(tau),)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Last step, decayed; and its derivative by tau."""
        step = situation.rows.step
        if values.size == 1:
            return Signature(extension=step[None])
        delay, tau = _delays(situation.rows), time_constant(values[1])
        decayed = step * np.exp(-delay / tau)
        return Signature(extension=np.stack([decayed, values[0] * decayed * delay / tau**2]))


def _delays(rows: Rows) -> Array:
    return rows.channels["delay_s"]


def _delays_differ(rows: Rows) -> bool:
    if "delay_s" not in rows.channels:
        return False
    delays = _delays(rows)[rows.on_platform]
    return bool(np.isfinite(delays).all() and np.ptp(delays) > 0.01 * delays.max())


EFFECTS = (Settling(),)
