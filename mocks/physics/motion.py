"""One leg's motion as an analytic function of machine time.

A command starts a *segment*: a quintic from the present position and velocity to the target at
rest. Positions at any time, past ones included, follow from the segments, so there is no
simulation loop and any thread may ask. Each segment also remembers the state of the play
elements (lost motion, hysteresis) at its start.
"""

import bisect
import threading
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from mocks.clock import Clock
from mocks.physics.play import Array, advance

KEPT_SEGMENTS = 400
SMALLEST_STEP_MM = 1e-9
STOPPING_S = 0.05


@dataclass(frozen=True)
class Segment:
    """A motion from ``start`` to ``target`` (mm), beginning at ``time`` (s) with ``velocity``.

    ``play`` is the offset of each play element at the beginning, mm. ``step`` and ``settled_from``
    describe the last move that was one: its length and the time at which it ended.
    """

    time: float
    duration: float
    start: float
    velocity: float
    target: float
    play: Array
    step: float
    settled_from: float

    @property
    def end(self) -> float:
        """Time at which the leg rests, s."""
        return self.time + self.duration

    def position(self, times: Array) -> Array:
        """Extension at ``times`` (N,), mm: quintic with zero end velocity and acceleration."""
        if self.duration <= 0.0:
            return np.full(np.shape(times), self.target)
        u = np.clip((times - self.time) / self.duration, 0.0, 1.0)
        rise = u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
        slide = u - u**3 * (6.0 - 8.0 * u + 3.0 * u**2)
        way = self.target - self.start
        return np.asarray(self.start + way * rise + self.velocity * self.duration * slide)

    def speed(self, time: float) -> float:
        """Velocity at ``time``, mm/s."""
        if self.duration <= 0.0 or not self.time <= time < self.end:
            return 0.0
        u = (time - self.time) / self.duration
        rise = 30.0 * u**2 * (1.0 - u) ** 2
        slide = 1.0 - u**2 * (18.0 - 32.0 * u + 15.0 * u**2)
        return (self.target - self.start) * rise / self.duration + self.velocity * slide


@dataclass(frozen=True)
class LegHistory:
    """What one leg did until each of N instants.

    ``extension`` (N,) mm; ``play`` (N, K) mm; ``step`` (N,) mm: last move, grown with its
    progress; ``delay`` (N,) s since it ended, negative while it lasts.
    """

    extension: Array
    play: Array
    step: Array
    delay: Array


class LegMotion:
    """One leg: encoder extension s in mm, 0 at home.

    Parameters
    ----------
    clock : Clock
        Machine time.
    play_widths : sequence of float, shape (K,)
        Full widths in mm of the play elements whose state this leg carries along.
    """

    def __init__(self, clock: Clock, play_widths: Sequence[float] = ()) -> None:
        self._clock = clock
        self._widths = np.asarray(play_widths, dtype=float)
        self._lock = threading.Lock()
        rest = Segment(-1e9, 0.0, 0.0, 0.0, 0.0, np.zeros(self._widths.size), 0.0, -1e9)
        self._segments = [rest]
        self._target = 0.0
        self._stalled = False

    def command(self, target_extension_mm: float, duration_s: float) -> None:
        """Move to ``target_extension_mm`` in ``duration_s`` machine seconds, from wherever it is.

        A stalled leg takes the target and stays where it stands.
        """
        with self._lock:
            self._target = float(target_extension_mm)
            if not self._stalled:
                self._begin(self._target, max(float(duration_s), 0.0))

    def stop(self) -> None:
        """Brake to rest within 0.05 s of machine time."""
        with self._lock:
            now = self._clock.now()
            speed = self._segments[-1].speed(now)
            if speed == 0.0:
                return
            self._target = float(self._at(now)) + 0.5 * speed * STOPPING_S
            self._begin(self._target, STOPPING_S)

    def position(self) -> float:
        """Encoder extension now, mm."""
        with self._lock:
            return float(self._at(self._clock.now()))

    @property
    def target(self) -> float:
        """Extension that was commanded last, mm."""
        return self._target

    @property
    def moving(self) -> bool:
        """Whether the leg is under way; False for a stalled leg, wherever its target is."""
        with self._lock:
            return not self._stalled and self._clock.now() < self._segments[-1].end

    @property
    def stalled(self) -> bool:
        """Whether the leg is jammed: it stays where it is whatever is commanded."""
        return self._stalled

    @stalled.setter
    def stalled(self, jammed: bool) -> None:
        with self._lock:
            if jammed and not self._stalled:
                self._begin(float(self._at(self._clock.now())), 0.0)
            self._stalled = jammed

    def history(self, times: Array) -> LegHistory:
        """What the leg did until each of ``times`` (N,), machine seconds."""
        with self._lock:
            segments = list(self._segments)
        starts = [segment.time for segment in segments]
        extension = np.empty(times.shape)
        play = np.empty((times.size, self._widths.size))
        step = np.empty(times.shape)
        delay = np.empty(times.shape)
        which = np.array([max(bisect.bisect_right(starts, t) - 1, 0) for t in times])
        for index in np.unique(which):
            segment, rows = segments[index], which == index
            s = segment.position(times[rows])
            way = segment.target - segment.start
            moved = abs(way) > SMALLEST_STEP_MM and segment.duration > 0.0
            progress = np.clip((s - segment.start) / way, 0.0, 1.0) if moved else 1.0
            extension[rows] = s
            play[rows] = advance(
                np.broadcast_to(segment.play, (s.size, segment.play.size)),
                (s - segment.start)[:, None],
                self._widths,
            )
            step[rows] = segment.step * progress
            delay[rows] = times[rows] - segment.settled_from
        return LegHistory(extension, play, step, delay)

    def remembered(self, times: Array, tau: float) -> Array:
        """Sum (N,) of all that was moved until ``times``, each move faded by exp(-age / ``tau``).

        Ages count in s from the end of a move; one that lasts has age 0 and counts as far as it
        has come.
        """
        with self._lock:
            segments = list(self._segments)
        left = np.zeros(times.shape)
        broken_off = [*(segment.time for segment in segments[1:]), np.inf]
        for segment, next_one in zip(segments, broken_off, strict=True):
            begun = times >= segment.time
            end = min(segment.end, next_one)
            way = segment.position(np.minimum(times[begun], end)) - segment.start
            left[begun] += way * np.exp(-np.maximum(times[begun] - end, 0.0) / tau)
        return left

    def _at(self, time: float) -> Array:
        return self._segments[-1].position(np.asarray(time))

    def _begin(self, target: float, duration: float) -> None:
        now = self._clock.now()
        last = self._segments[-1]
        here = float(last.position(np.asarray(now)))
        speed = last.speed(now) if duration > 0.0 else 0.0
        play = advance(last.play[None, :], np.array([[here - last.start]]), self._widths)[0]
        moves = abs(target - here) > SMALLEST_STEP_MM
        step = target - here if moves else last.step
        settled_from = now + duration if moves else last.settled_from
        self._segments.append(Segment(now, duration, here, speed, target, play, step, settled_from))
        del self._segments[:-KEPT_SEGMENTS]
