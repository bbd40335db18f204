"""Friction: a small step ends short, extension_i = -a_i sign(d_i) exp(-|d_i| / reach).

d_i is the last change of s_i. A long step arrives; a short one is left hanging by the friction that
it has not yet overcome.
"""

from collections.abc import Iterator

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, alone, per_actuator
from calib.runs.stack import Rows
from calib.unknown import Unknown

SMALL = 0.05
"""Quantile of the steps that counts as small: a quarter of it is the shortest reach tried."""
LONGEST = 30.0
"""Longest reach tried, as a multiple of 50 usual lost motions (1 mm of a leg)."""
TRIALS = 12
PER_UNIT = 50.0


class StickSlip(Effect):
    """How far each actuator falls short after the smallest step, and one ``reach`` for all."""

    id = "stick-slip"
    kind = "machine"
    says = "legs or drives fall short after small steps: friction (stick-slip)"
    depends = ("step",)

    def unavailable(self, rows: Rows) -> str:
        """Steps must differ."""
        return "" if np.any(rows.step[:, rows.on_platform]) else "no row follows a move"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``stick-slip.leg1`` .., mm or rad; ``.reach`` in the unit of the first actuator."""
        axes = rows.machine.axes
        short = (Unknown(f"stick-slip.{axis.name}", axis.unit, axis.lost_motion) for axis in axes)
        reach = PER_UNIT * axes[0].lost_motion
        return (*short, Unknown("stick-slip.reach", axes[0].unit, reach, nonlinear=True))

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each actuator alone."""
        return alone(len(rows.machine.actuators))

    def trials(self, rows: Rows) -> Iterator[tuple[float, ...]]:
        """From what the smallest steps could show to thirty millimetres, in equal ratios."""
        unit = PER_UNIT * rows.machine.axes[0].lost_motion
        way = (np.abs(rows.step) / _sizes(rows)[:, None])[:, rows.on_platform]
        small = max(float(np.quantile(own[own > 0.0], SMALL)) for own in way if np.any(own))
        shortest = 0.25 * small * unit / PER_UNIT
        longest = max(LONGEST * unit, 4.0 * shortest)
        for reach in np.geomspace(shortest, longest, TRIALS):
            yield (float(reach),)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """What is left, against the step; and its derivative by the reach."""
        rows = situation.rows
        reach = float(values[-1]) * _sizes(rows) / rows.machine.axes[0].lost_motion
        step, count = rows.step, reach.size
        short = -np.sign(step) * np.exp(-np.abs(step) / reach[:, None])
        slope = values[:count, None] * short * np.abs(step) / reach[:, None] / float(values[-1])
        return Signature(extension=np.concatenate([per_actuator(short), slope[None]]))


def _sizes(rows: Rows) -> Array:
    return np.array([axis.lost_motion for axis in rows.machine.axes])


EFFECTS = (StickSlip(),)
