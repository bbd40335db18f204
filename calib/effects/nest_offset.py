"""A nest is not where the drawing says: three components for each platform nest."""

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, alone
from calib.runs.stack import Rows
from calib.unknown import Unknown

SIGMA_MM = 0.05


class NestOffset(Effect):
    """What geometry or frames absorb of it stays with them."""

    id = "nest-offset"
    kind = "measurement"
    says = "an SMR nest is not where the drawing says"

    def unavailable(self, rows: Rows) -> str:
        """Some nest of the platform must have been read."""
        return "" if rows.on_platform.any() else "no nest of the platform has been read"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``nest-offset.4.x`` ..., mm, platform frame."""
        return tuple(
            Unknown(f"nest-offset.{name}.{axis}", "mm", SIGMA_MM, sigma=SIGMA_MM)
            for name in nests_of(rows)
            for axis in "xyz"
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each nest alone."""
        return alone(len(nests_of(rows)), 3)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """A unit step of one nest along one platform axis."""
        return Signature(nest=nest_steps(situation.rows))


def nest_steps(rows: Rows) -> Array:
    """Unit steps (3 nests, 3, N) of each nest along each platform axis."""
    names = nests_of(rows)
    shape = np.zeros((3 * len(names), 3, rows.count))
    which = np.array([names.index(n) if n in names else -1 for n in rows.nest_name])
    for nest in range(len(names)):
        for axis in range(3):
            shape[3 * nest + axis, axis] = which == nest
    return shape


def nests_of(rows: Rows) -> list[str]:
    """Platform nests that hold readings, in the order of the drawing."""
    seen = {name for name, on in zip(rows.nest_name, rows.on_platform, strict=True) if on}
    listed = dict.fromkeys(name for run in rows.runs for name in run.header.platform_nests)
    return [name for name in listed if name in seen]


EFFECTS = (NestOffset(),)
