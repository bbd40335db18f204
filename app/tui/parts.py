"""What a picture of a job is made of: steps, readings, lines of the log, trouble."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from app.session.events import Vector
from calib.arrays import Array
from calib.frames import Frame

RunState = Literal["idle", "running", "paused", "waiting", "stopped", "fault", "finished"]
StepMark = Literal["planned", "started", "done", "failed", "skipped"]
Level = Literal["info", "good", "warn", "bad"]


@dataclass
class StepLine:
    """One line of the step list."""

    id: str
    says: str
    state: str = "planned"
    note: str = ""


@dataclass(frozen=True)
class Point:
    """A reading as the plots need it: how far from its prediction, and how sure, mm (rad).

    Readings taken before the base was found in the tracker's frame are not among them: they would
    only show how roughly the tracker was put down. ``place`` is where it was predicted and ``off``
    from there to where it was read, base frame, mm; zeros where a gauge read a number.
    """

    number: int
    pose: str
    nest: str
    miss_mm: float
    sigma_mm: float
    place: Vector = (0.0, 0.0, 0.0)
    off: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class LogLine:
    """One line of the log; ``time_s`` is machine time since the start of the run."""

    time_s: float | None
    level: Level
    text: str


@dataclass(frozen=True)
class Trouble:
    """Something to put on the banner: what happened, and what to do."""

    what: str
    remedy: str
    level: Literal["warn", "bad"] = "bad"
    passing: bool = False
    """It answers a key and says nothing of the machine: the next key takes it away."""
    over: "Trouble | None" = None
    """What it covers for that long, a fault of the machine for instance."""


def reading_point(
    number: int,
    pose: str,
    nest: str,
    seen: Sequence[float],
    predicted: Sequence[float],
    sigma_mm: float,
    frame: Sequence[float],
) -> Point:
    """A reading and its prediction, both in the tracker's frame; ``frame`` is that of the base."""
    back = Frame.of(frame).inverse()
    at, there = back.apply(np.array(predicted)), back.apply(np.array(seen))
    return Point(
        number, pose, nest, math.dist(seen, predicted), sigma_mm, vector(at), vector(there - at)
    )


def vector(values: Array) -> Vector:
    """Three numbers."""
    x, y, z = map(float, values)
    return x, y, z


def ends(nest: str, nest2: str) -> str:
    """What a gauge reads: a nest, or a pair."""
    return f"{nest}-{nest2}" if nest2 else nest
