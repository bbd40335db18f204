"""One-sided contact: beyond some place an actuator works against a cable, a bellows or a stop.

    extension_i = k_i max(0, side (s_i - s0_i)),   s0_i = low_i + at (high_i - low_i)

``at`` is the place as a part of the way between the actuators' limits, ``side`` +1 where the
contact is felt beyond it and -1 where short of it.
"""

from collections.abc import Iterator

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect, Signature, Situation, alone, per_actuator
from calib.mechanism.description import Machine
from calib.runs.stack import Rows
from calib.unknown import Choice, Unknown

INNER = 0.2
"""Part of the readings at either end of an actuator's way between which no contact is tried."""
TRIALS = 5
SIDE = Choice(((1.0, "beyond it"), (-1.0, "short of it")))


class Contact(Effect):
    """How much each actuator yields per way beyond the contact; one place for all."""

    id = "contact"
    kind = "machine"
    says = "something one-sided pulls or stops legs or drives beyond some place (cable, bellows)"

    def unavailable(self, rows: Rows) -> str:
        """Actuators must move."""
        return "" if np.any(rows.step[:, rows.on_platform]) else "no row follows a move"

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """``contact.leg1`` .., a ratio; ``.at`` part of the way, ``.side`` +1 or -1."""
        slopes = (Unknown(f"contact.{axis.name}", "1", 1e-3) for axis in rows.machine.axes)
        return (
            *slopes,
            Unknown("contact.at", "1", 0.1, sigma=0.3, nonlinear=True),
            Unknown("contact.side", "1", 1.0, sigma=1e-6, nonlinear=True, means=SIDE),
        )

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """Each actuator alone."""
        return alone(len(rows.machine.actuators))

    def trials(self, rows: Rows) -> Iterator[tuple[float, ...]]:
        """Places that the readings lie on both sides of, from either side."""
        for side in (1.0, -1.0):
            for at in _tried(rows):
                yield (float(at), side)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """Way beyond the place; and the derivative by the place."""
        rows = situation.rows
        at, side = float(values[-2]), float(np.sign(values[-1]))
        low, high = _limits(rows.machine)
        beyond = np.maximum(0.0, side * (_places(rows) - at))
        way = (high - low)[:, None]
        slope = -side * values[:-2, None] * way * (beyond > 0.0)
        shape = per_actuator(beyond * way)
        return Signature(extension=np.concatenate([shape, slope[None], np.zeros_like(shape[:1])]))


def _limits(machine: Machine) -> tuple[Array, Array]:
    """Extensions (n,) at the limits, the lower first."""
    ends = machine.extension(machine.q_limits)
    return ends.min(axis=1), ends.max(axis=1)


def _places(rows: Rows) -> Array:
    """Where each actuator is, as a part of the way between its limits, (n, N)."""
    low, high = _limits(rows.machine)
    return np.asarray((rows.extension - low[:, None]) / (high - low)[:, None])


def _tried(rows: Rows) -> Array:
    """Places that are tried: within the bulk of the readings of most actuators."""
    if not rows.on_platform.any():
        return np.full(1, 0.5)
    seen = _places(rows)[:, rows.on_platform]
    low, high = np.median(np.quantile(seen, [INNER, 1.0 - INNER], axis=1), axis=1)
    return np.linspace(low, high, TRIALS)


EFFECTS = (Contact(),)
