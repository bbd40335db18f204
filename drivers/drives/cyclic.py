"""Cyclic synchronous position: set-points by RPDO, taken by all drives at the same SYNC."""

import threading
import time
from collections.abc import Sequence

from drivers.canopen.drive402 import TARGET_POSITION
from drivers.drives.bus import DriveBus
from drivers.drives.sync import SYNC, setpoint_frame
from drivers.drives.way import Counts, Straight, Table, Way
from drivers.errors import LinkLost
from drivers.interface import Alarm


class Stream:
    """Sends the set-points of all drives, then SYNC, each period, from :meth:`start` to the stop.

    A set-point is a period of machine time after the one before it, however late it is sent: a
    busy computer makes a motion longer, never faster, and whoever listens is told.
    """

    def __init__(self, bus: DriveBus) -> None:
        self._bus = bus
        self._period_s = bus.plan.sync_s
        self._step_s = bus.plan.sync_s * bus.plan.time_scale
        self._way: Way | None = None
        self._time = 0.0
        self._next: Counts | None = None
        self._held: Counts = ()
        self._late: list[float] = []
        self._end = threading.Event()
        self._thread: threading.Thread | None = None
        self._lock = threading.Lock()

    def start(self, held: Sequence[int]) -> None:
        """Begin to send, holding every drive where it stands."""
        self.stop()
        self._held, self._way, self._next = tuple(held), None, None
        self._end = threading.Event()
        self._thread = threading.Thread(target=self._run, name="canopen-sync", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """End it."""
        self._end.set()
        if self._thread is not None:
            self._thread.join(1.0)
            self._thread = None

    def hold(self, n: int, counts: int) -> None:
        """Let drive ``n`` stay at ``counts``: it was moved by itself meanwhile."""
        with self._lock:
            held = list(self._held)
            held[n] = counts
            self._held, self._way, self._next = tuple(held), None, None

    def go(self, targets: Sequence[int]) -> None:
        """Begin the way to ``targets``; what is under way is braked to rest before.

        Not while a trajectory is played: that has no ramp on which it could be braked.
        """
        with self._lock:
            if self._way is None:
                self._begin(Straight.of(self._bus.axes, self._held, tuple(targets)))
            else:
                assert not isinstance(self._way, Table)
                self._begin(self._way.braked(self._time))
                self._next = tuple(targets)

    def play(self, table: Table) -> None:
        """Begin a trajectory that starts where all are held."""
        with self._lock:
            self._begin(table)

    @property
    def held(self) -> Counts:
        """The set-points that were sent last."""
        with self._lock:
            return self._held

    @property
    def over(self) -> bool:
        """Whether the last way is behind."""
        with self._lock:
            return self._way is None

    @property
    def plays(self) -> bool:
        """Whether a trajectory is under way."""
        with self._lock:
            return isinstance(self._way, Table)

    def _begin(self, way: Way) -> None:
        self._way, self._time, self._late = way, 0.0, []

    def _step(self) -> Counts:
        """Set-points one period on."""
        with self._lock:
            if any(drive.stopped for drive in self._bus.drives):
                self._way = self._next = None
            if self._way is not None:
                self._time += self._step_s
                self._held = self._way.at(self._time)
                if self._time >= self._way.duration:
                    self._arrive()
            return self._held

    def _arrive(self) -> None:
        self._tell_late()
        targets, self._way, self._next = self._next, None, None
        if targets is not None:
            self._begin(Straight.of(self._bus.axes, self._held, targets))

    def _tell_late(self) -> None:
        if self._late:
            times = "once" if len(self._late) == 1 else f"{len(self._late)} times"
            what = (
                f"SYNC came late {times} in a motion, at most by {max(self._late):.3g} s: it took "
                f"{sum(self._late):.3g} s longer"
            )
            remedy = 'Choose a longer sync_s or mode = "profile", or keep this computer free.'
            self._bus.link.in_loop(self._bus.alarm, Alarm("drives", what, remedy))

    def _run(self) -> None:
        due = time.monotonic()
        while not self._end.wait(max(due - time.monotonic(), 0.0)):
            drives = self._bus.drives
            frames = []
            for drive, counts in zip(drives, self._step(), strict=True):
                drive.tell(TARGET_POSITION, counts)
                frames.append(setpoint_frame(drive, counts))
            try:
                self._bus.link.send_now([*frames, SYNC])
            except LinkLost as error:
                self._bus.link.latch("link", error)
                return
            sent = time.monotonic()
            if sent - due > self._period_s:
                self._late.append(sent - due)
            # What was late shifts all that follows: two SYNCs are never nearer than half a period.
            due = max(due + self._period_s, sent + 0.5 * self._period_s)
