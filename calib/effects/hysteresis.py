"""Elastic lost motion: friction drags a spring behind each actuator, with a memory of its way.

    extension_i = -h_i (s_i - w_i) / reach,   w_i follows s_i within +-reach

After a reversal the error goes over from one side to the other along 2 ``reach`` of way, however
many moves that takes (a play operator; Prandtl's model of one element). With a reach shorter than
every move it is ``backlash`` of 2 h_i.
"""

from collections.abc import Iterator
from functools import lru_cache

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, alone, per_actuator
from calib.runs.commanded import CommandedPath
from calib.runs.stack import Rows
from calib.unknown import Unknown

SHORTEST, LONGEST = 25.0, 800.0
"""Reaches that are tried, as multiples of the usual lost motion: 0.5 to 16 mm of a leg."""
TRIALS = 6


class Hysteresis(Effect):
    """One half width for each actuator, and one ``reach`` for all."""

    id = "hysteresis"
    kind = "machine"
    says = "legs or drives lag behind by friction and elasticity, and remember where they turned"
    depends = ("path",)

    def unavailable(self, rows: Rows) -> str:
        """Something must move."""
        return "" if np.any(rows.step[:, rows.on_platform]) else "no row follows a move"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``hysteresis.leg1`` .., mm or rad; ``.reach`` in the unit of the first actuator."""
        axes = rows.machine.axes
        widths = (Unknown(f"hysteresis.{axis.name}", axis.unit, axis.usual_error) for axis in axes)
        reach = SHORTEST * axes[0].lost_motion
        return (*widths, Unknown("hysteresis.reach", axes[0].unit, reach, nonlinear=True))

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each actuator alone."""
        return alone(len(rows.machine.actuators))

    def trials(self, rows: Rows) -> Iterator[tuple[float, ...]]:
        """From what backlash cannot be to most of the way, in equal ratios."""
        unit = rows.machine.axes[0].lost_motion
        for reach in np.geomspace(SHORTEST * unit, LONGEST * unit, TRIALS):
            yield (float(reach),)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Where each actuator stands within its reach; and the derivative by the reach."""
        rows = situation.rows
        sizes = np.array([axis.lost_motion for axis in rows.machine.axes])
        scale = sizes / sizes[0]
        reach = float(values[-1]) * scale
        behind, moved = _behind(rows.path, tuple(map(float, reach)))
        behind, moved = behind[:, rows.at], moved[:, rows.at]
        shape = per_actuator(-behind / reach[:, None])
        by_reach = (-moved * reach[:, None] + behind) / reach[:, None] ** 2 * scale[:, None]
        slope = values[:-1, None] * by_reach
        return Signature(extension=np.concatenate([shape, slope[None]]))


@lru_cache(maxsize=2 * TRIALS)
def _behind(path: CommandedPath, reaches: tuple[float, ...]) -> tuple[Array, Array]:
    """s - w at each row of the path, and its derivative by the reach, (n, M) both.

    The same reaches are tried of the same path whatever else the model holds: they are kept.
    """
    change, count = path.change, path.change.shape[0]
    reach = np.array(reaches)

    def move(state: Array, row: int) -> Array:
        gone = state[:count] + change[:, row]
        clipped = np.minimum(np.maximum(gone, -reach), reach)
        slope = np.where(gone == clipped, state[count:], np.sign(clipped))
        return np.concatenate([clipped, slope])

    states = path.carry(np.zeros((2 * count, change.shape[1])), move)
    return states[:count], states[count:]


EFFECTS = (Hysteresis(),)
