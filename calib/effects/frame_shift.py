"""The base reference or the tool changed at some moment of the run: a rigid step.

Either all platform nests step in the platform frame (a tool touched), or the base frame steps in
the tracker frame (base or tracker touched). The moment is searched between the readings. Several
runs stand one after the other on its clock; a run begins with nests and frames as they then are.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Scan, Signature, Situation
from calib.effects.run_clock import about, between, from_then_on, moment_of, run_starts, spread
from calib.effects.tracker import rigid_motions
from calib.mechanism.rigid import cross, rotate
from calib.runs.stack import Rows
from calib.unknown import Choice, Unknown

WHERE = Choice(((0.0, "the nests on the platform"), (1.0, "the base")))
EDGE = 0.06
"""Part of the readings at either end in which a step cannot be told from bad readings."""


class FrameShift(Effect):
    """Three translations and three rotations; ``where`` is 0 for the platform, 1 for the base."""

    id = "frame-shift"
    kind = "measurement"
    says = "the base reference or the tool changed at some moment of the run"
    ends_with_run = True

    def unavailable(self, rows: Rows) -> str:
        """Time must pass."""
        return "" if _every_moment(rows).size else "all readings have the same time"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``frame-shift.x`` .. ``.rz``, mm and rad; ``.t0`` in s; ``.where``."""
        moments = spread(_every_moment(rows))
        gap = float(np.median(np.diff(moments))) if len(moments) > 1 else 1.0
        return (
            *(Unknown(f"frame-shift.{axis}", "mm", 0.05) for axis in ("x", "y", "z")),
            *(Unknown(f"frame-shift.{axis}", "rad", 1e-4) for axis in ("rx", "ry", "rz")),
            Unknown("frame-shift.t0", "s", gap, sigma=gap, nonlinear=True, means=moment_of(rows)),
            Unknown("frame-shift.where", "1", 1.0, sigma=1e-6, nonlinear=True, means=WHERE),
        )

    def trials(self, rows: Rows) -> Iterator[tuple[float, ...]]:
        """Every moment, on the platform and on the base."""
        for where in (0.0, 1.0):
            for moment in spread(_every_moment(rows)):
                yield (float(moment), where)

    def refined(self, rows: Rows, trial: tuple[float, ...]) -> Iterator[tuple[float, ...]]:
        """Every moment between the neighbouring ones that were tried, within one time too."""
        tried = spread(_every_moment(rows))
        for moment in about(tried, _between(rows, rows.moment), trial[0]):
            yield (float(moment), trial[1])

    def scan(self, situation: Situation, trials: Sequence[tuple[float, ...]]) -> Scan | None:
        """Rigid motions of the platform's nests, and of the base, from every moment on."""
        rows = situation.rows
        still = np.zeros(3)
        return Scan(
            (
                Signature(nest=_motions(rows.nest, still) * rows.on_platform),
                Signature(point=_of_base(situation, still)),
            ),
            np.array([where > 0.5 for _, where in trials], dtype=np.intp),
            np.array([[from_then_on(rows, rows.moment, moment)] for moment, _ in trials], float),
        )

    def signature(self, situation: Situation, values: Array) -> Signature:
        """A rigid motion of everything read after the moment."""
        rows = situation.rows
        moment, where = values[6], values[7]
        after = from_then_on(rows, rows.moment, float(moment)).astype(np.float64)
        shape = np.zeros((8, 3, rows.count))
        if where > 0.5:
            shape[:6] = _of_base(situation, values[3:6]) * after
            return Signature(point=shape)
        shape[:6] = _motions(rows.nest, values[3:6]) * after * rows.on_platform
        return Signature(nest=shape)


def _motions(point: Array, turn: Array) -> Array:
    """Unit motions (6, 3, N) that, times the values, are the whole rigid motion by ``turn`` (3,).

    exp([w]) p - p = w x V p with V = 1 + (1 - cos a) / a^2 [w] + (a - sin a) / a^3 [w]^2, a = |w|:
    a tracker that was carried elsewhere turns by more than the first order can say.
    """
    angle = float(np.linalg.norm(turn))
    w = turn[:, None]
    if angle > 1e-3:
        first, second = (1.0 - np.cos(angle)) / angle**2, (angle - np.sin(angle)) / angle**3
    else:
        first, second = 0.5, 1.0 / 6.0
    once = cross(w, point)
    motions = rigid_motions(point + first * once + second * cross(w, once))
    motions[:3] = rigid_motions(point)[:3]
    return motions


def _of_base(situation: Situation, turn: Array) -> Array:
    """Unit motions (6, 3, N) of the base frame, in the tracker frame."""
    motions = _motions(situation.base_point, turn)
    return np.stack([rotate(situation.frame_rotation, one) for one in motions])


def _every_moment(rows: Rows) -> Array:
    """Moments between successive times, away from the ends of each run."""
    return _between(rows, rows.time_s)


def _between(rows: Rows, times: Array) -> Array:
    """Moments between successive ``times`` (N,) of a run, away from its ends."""
    found = []
    for run, start in enumerate(run_starts(rows)):
        here = np.sort(times[rows.run == run])
        found.append(start + between(here, max(2, int(EDGE * here.size))))
    return np.concatenate(found)


EFFECTS = (FrameShift(),)
