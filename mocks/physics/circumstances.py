"""What an actuator's errors depend on, and how large things are in its unit.

Extensions are in the actuator's unit, mm or rad.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mocks.physics.pose import Array

REFERENCE_C = 20.0
Ends = float | tuple[float, ...]


@dataclass(frozen=True)
class Stroke:
    """How large things are in an actuator's unit.

    ``per_mm``: what moves the machine as 1 mm of a leg does; ``cycle``: period of the cyclic
    error where none is given; ``speed``: per s; ``counts``: the drive's counts in a unit;
    ``digits``: decimals of q in a file; ``smallest``: change that reverses an actuator;
    ``ends``: how far it may go, all alike or each; ``gears``: turns of each motor for one of its
    joint.
    """

    per_mm: float = 1.0
    cycle: float = 4.0
    speed: float = 20.0
    counts: float = 1e6
    digits: int = 6
    smallest: float = 1e-4
    ends: tuple[Ends, Ends] = (-35.715, 34.285)
    gears: tuple[float, ...] = ()


MILLIMETRES = Stroke()
SLIDE = Stroke(ends=(-130.0, 20.0))
RADIANS = Stroke(1.0 / 317.0, 2.0 * np.pi, 0.2, 1e9, 9, 1e-6, (np.radians(-55.0), np.radians(50.0)))


@dataclass(frozen=True)
class Circumstances:
    """What the actuators' errors depend on, at N instants.

    ``extension`` s (N, n) as the encoders read it; ``play`` (N, n, K); ``step`` (N, n), the last
    move; ``delay`` (N, n) s since it ended (negative while it lasts); temperatures (N,) deg C;
    ``payload`` (N,) kg. ``remembered`` tells for a time constant in s the sum (N, n) of all moves
    that were made, each times exp(-age / time constant). ``time`` (N,) s since the run (of the
    live machine: the day) began.
    """

    extension: Array
    play: Array
    step: Array
    delay: Array
    structure: Array
    air: Array
    payload: Array
    remembered: Callable[[float], Array]
    time: Array
