"""Cyclic synchronous position: set-points by RPDO, taken by all drives at the same SYNC."""

import logging
import struct
import threading
import time
from collections.abc import Sequence
from dataclasses import dataclass

from drivers.canopen.drive402 import TARGET_POSITION, Drive402
from drivers.canopen.link import CanLink
from drivers.drives.profile import Profile
from drivers.errors import LinkLost, Refused

logger = logging.getLogger(__name__)
SYNC = (0x80, b"")
INTERPOLATION = 0x60C2
INVALID = 1 << 31
COMMUNICATION, MAPPING, BASE = 0x1401, 0x1601, 0x300


async def map_setpoint(drive: Drive402, node: int, period_s: float) -> None:
    """Map 0x607A alone into RPDO 2, taken at each SYNC, and set 0x60C2; raises Refused.

    0x60C2 is not in every drive: those without it take the period from SYNC itself.
    """

    def write() -> None:
        device, cob_id = drive.remote, BASE + node
        steps = (
            (COMMUNICATION, 1, struct.pack("<I", cob_id | INVALID)),
            (MAPPING, 0, b"\0"),
            (MAPPING, 1, struct.pack("<I", TARGET_POSITION << 16 | 32)),
            (MAPPING, 0, b"\1"),
            (COMMUNICATION, 2, b"\1"),
            (COMMUNICATION, 1, struct.pack("<I", cob_id)),
        )
        for index, sub, data in steps:
            device.download(index, sub, data)

    try:
        await drive.remote.call(write)
    except Refused as error:
        raise Refused(
            f"does not let its RPDO 2 be mapped: {error.what}",
            device=drive.device,
            remedy='Use mode = "profile".',
            code=error.code,
        ) from error
    if drive.has(INTERPOLATION, 1):
        await drive.write(INTERPOLATION, round(period_s * 1000.0), 1)
        await drive.write(INTERPOLATION, -3, 2)


@dataclass(frozen=True)
class _Way:
    starts: tuple[int, ...]
    targets: tuple[int, ...]
    profile: Profile
    begin_s: float


class Stream:
    """Sends the set-points of all drives, then SYNC, each period, from :meth:`start` to the stop.

    The thread keeps its own time; a period that comes late is made up for by the next, so that
    set-points stay on the profile. ``time_scale``: machine seconds a wall second.
    """

    def __init__(
        self, link: CanLink, drives: Sequence[Drive402], period_s: float, time_scale: float
    ) -> None:
        self._link = link
        self._drives = tuple(drives)
        self._period_s = period_s
        self._time_scale = time_scale
        self._way: _Way | None = None
        self._held: tuple[int, ...] = ()
        self._end = threading.Event()
        self._thread: threading.Thread | None = None
        self._lock = threading.Lock()

    def start(self, held: Sequence[int]) -> None:
        """Begin to send, holding every drive where it stands."""
        self.stop()
        self._held, self._way = tuple(held), None
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
            self._held, self._way = tuple(held), None

    def go(self, targets: Sequence[int], profile: Profile) -> None:
        """Begin the way from the present set-points to ``targets``."""
        with self._lock:
            self._way = _Way(self._held, tuple(targets), profile, time.monotonic())

    @property
    def over(self) -> bool:
        """Whether the last way is behind."""
        with self._lock:
            return self._way is None

    def _setpoints(self, now: float) -> tuple[int, ...]:
        with self._lock:
            way = self._way
            if way is not None:
                part = way.profile.at((now - way.begin_s) * self._time_scale)
                pairs = zip(way.starts, way.targets, strict=True)
                self._held = tuple(round(a + part * (b - a)) for a, b in pairs)
                if part >= 1.0:
                    self._way = None
            return self._held

    def _run(self) -> None:
        due = time.monotonic()
        while not self._end.wait(max(due - time.monotonic(), 0.0)):
            now = time.monotonic()
            due = max(due + self._period_s, now)
            frames = []
            for drive, counts in zip(self._drives, self._setpoints(now), strict=True):
                drive.tell(TARGET_POSITION, counts)
                frames.append((BASE + drive.remote.id, struct.pack("<i", counts)))
            try:
                self._link.send_now([*frames, SYNC])
            except LinkLost as error:
                logger.info("%s", error)
                return
