"""A motorised total station as a tracker: it aims by its target recognition, and reads a prism.

Frame of its readings, mm: x to the right of horizontal zero, y along it, z up; horizontal angles
count clockwise from y, vertical ones from the zenith.
"""

import asyncio
import math
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass

from drivers import plausible
from drivers.errors import BeamBroken, DeviceError, NoTarget, Refused
from drivers.geocom.codes import LOST, NOT_YET, PRISMS, WHOLE, Rc, Rpc, in_words
from drivers.geocom.link import Answer, GeoComLink
from drivers.interface import (
    Alarm,
    Identity,
    TrackerCan,
    TrackerReading,
    TrackerState,
    TrackSample,
)
from drivers.stopping import stopped

MEASURE, CLEAR, AUTO = 1, 3, 1
"""Measurement programs (start, clear) and inclination by the instrument itself."""
POLL_MS = 200
TURN, NEAREST_M = 4.0 * math.pi, 0.01
"""Angles (rad) and distances that can be, at most and at least."""
"""How long one question for a distance waits, ms of the instrument's time."""
Vector = tuple[float, float, float]


@dataclass(frozen=True)
class StationSettings:
    """What a total station is good for, and how long it takes.

    ``sigma_angle`` in rad and ``sigma_distance_mm`` with ``ppm`` are standard uncertainties of a
    reading; ``edm_s`` and ``turn_s`` the longest that a distance and a turn take, instrument time.
    """

    sigma_angle: float
    sigma_distance_mm: float
    ppm: float
    edm_s: float = 6.0
    turn_s: float = 30.0
    search_mm: float = 50.0


class TotalStation:
    """A total station (implements :class:`drivers.interface.Tracker`)."""

    def __init__(
        self, link: GeoComLink, identity: Identity, settings: StationSettings, time_scale: float
    ) -> None:
        self.identity = identity
        self.can = TrackerCan(points=True, searches=True, faces=True, reflectors=True)
        self._link, self._settings, self._scale = link, settings, time_scale
        self._alarms: list[Callable[[Alarm], None]] = []
        self._reflector = ""
        self._locked = False
        self._stops = 0
        link.on_lost = self._say

    @classmethod
    async def connect(
        cls, url: str, baud: int, margin_s: float, settings: StationSettings, time_scale: float
    ) -> "TotalStation":
        """Connect and ask who it is; raises ConnectFailed, Silence, ProtocolError."""
        link = await GeoComLink.open(url, baud, margin_s)
        try:
            number = await link.request(Rpc.CSV_GET_INSTRUMENT_NO)
            name = await link.request(Rpc.CSV_GET_INSTRUMENT_NAME)
            version = await link.request(Rpc.CSV_GET_SW_VERSION)
        except DeviceError:
            await link.close()
            raise
        identity = Identity(
            "geocom",
            "Leica",
            name.values[0].strip('"') if name.values else "",
            number.values[0] if number.values else "",
            ".".join(version.values),
        )
        return cls(link, identity, settings, time_scale)

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """Call ``callback`` for everything said unasked."""
        self._alarms.append(callback)

    def check(self) -> None:
        """Raise the fault that is standing."""
        self._link.check()

    async def state(self) -> TrackerState:
        """What it says of itself; locked: the last aiming found the prism."""
        face = await self._asked(Rpc.TMC_GET_FACE)
        side = int(face.numbers(1, self._link.device)[0]) + 1
        return TrackerState(True, True, self._locked, True, self._reflector, side)

    async def initialize(self) -> None:
        """Switch target recognition on, and forget an older distance."""
        await self._asked(Rpc.AUS_SET_USER_ATR_STATE, 1)
        await self._asked(Rpc.TMC_DO_MEASURE, CLEAR, AUTO)

    async def select_reflector(self, name: str) -> None:
        """Choose the type of prism; raises Refused for one that it does not know."""
        if name not in PRISMS:
            raise Refused(
                f'there is no prism type "{name}"',
                device=self._link.device,
                remedy=f"Write one of {', '.join(PRISMS)}",
            )
        await self._asked(Rpc.BAP_SET_PRISM_TYPE, PRISMS[name])
        self._reflector = name

    async def point_at(self, xyz: Vector) -> None:
        """Turn to a place and aim at the prism there; raises NoTarget."""
        x, y, z = xyz
        reach = math.hypot(x, y, z)
        if not reach > 0.0:
            raise Refused(
                "the instrument cannot aim at itself",
                device=self._link.device,
                remedy="Correct frame under [tracker] in the site file.",
            )
        horizontal, vertical = math.atan2(x, y), math.acos(z / reach)
        if (await self.state()).face == 2:
            horizontal, vertical = horizontal + math.pi, 2.0 * math.pi - vertical
        self._locked = False
        await self._aimed(Rpc.AUT_MAKE_POSITIONING, horizontal % (2.0 * math.pi), vertical, 0, 1, 0)

    async def find_reflector(self, distance_mm: float) -> None:
        """Search around the present direction, then aim; raises NoTarget."""
        half = math.atan2(self._settings.search_mm, max(distance_mm, 1.0))
        self._locked = False
        await self._aimed(Rpc.AUT_SEARCH, half, half, 0)
        await self._aimed(Rpc.AUT_FINE_ADJUST, half, half, 0)

    async def change_face(self) -> None:
        """Turn to the other face and aim again."""
        self._locked = False
        await self._aimed(Rpc.AUT_CHANGE_FACE, 0, 1, 0)

    async def measure(self, dwell_s: float) -> TrackerReading:
        """Mean of the distances and angles that a dwell has room for, one at least.

        Raises
        ------
        BeamBroken
            If there is no distance, or the operator stops it.
        """
        stops, loop = self._stops, asyncio.get_running_loop()
        end = loop.time() + dwell_s / self._scale
        samples = [await self._sample(stops)]
        while loop.time() < end:
            samples.append(await self._sample(stops))
        x, y, z = (sum(one[axis] for one in samples) / len(samples) for axis in range(3))
        return TrackerReading((x, y, z), self._covariance((x, y, z)))

    async def _sample(self, stops: int) -> Vector:
        """One distance with its angles, as a point."""
        started = await self._link.request(Rpc.TMC_DO_MEASURE, MEASURE, AUTO)
        self._refuse_unless(started, {Rc.OK})
        loop = asyncio.get_running_loop()
        end = loop.time() + self._settings.edm_s / self._scale + 1.0
        while True:
            if self._stops != stops:
                raise stopped(BeamBroken, self._link.device)
            wait_s = 1e-3 * POLL_MS / self._scale
            answer = await self._link.request(Rpc.TMC_GET_SIMPLE_MEA, POLL_MS, AUTO, wait_s=wait_s)
            if answer.code in WHOLE:
                return _point(self._link.device, *answer.numbers(3, self._link.device))
            if answer.code in LOST or loop.time() > end:
                self._locked = False
                raise BeamBroken(
                    f"no distance was measured: {in_words(answer.code)}",
                    device=self._link.device,
                    remedy="See that the prism is in its nest and the line of sight is free",
                )
            self._refuse_unless(answer, NOT_YET)
            await asyncio.sleep(0.0)

    def _covariance(self, xyz: Vector) -> tuple[float, float, float, float, float, float]:
        """That of its angles and its distance, turned: xx, yy, zz, xy, xz, yz in mm^2."""
        own = self._settings
        reach = math.hypot(*xyz)
        along = tuple(value / reach for value in xyz)
        deep = (own.sigma_distance_mm + 1e-6 * own.ppm * reach) ** 2
        across = (own.sigma_angle * reach) ** 2

        def entry(a: int, b: int) -> float:
            return (deep - across) * along[a] * along[b] + (across if a == b else 0.0)

        return entry(0, 0), entry(1, 1), entry(2, 2), entry(0, 1), entry(0, 2), entry(1, 2)

    def stream(self, separation_s: float) -> AsyncIterator[TrackSample]:
        """It has no continuous mode that is used here."""
        raise Refused(
            "there is no continuous mode",
            device=self._link.device,
            remedy="Measure point by point.",
        )

    async def channels(self) -> dict[str, float]:
        """It measures nothing of the machine or the air."""
        self.check()
        return {}

    async def stop(self) -> None:
        """End a dwell and every turn."""
        self._stops += 1
        try:
            await self._link.request(Rpc.MOT_STOP_CONTROLLER, 0)
            await self._link.request(Rpc.TMC_DO_MEASURE, CLEAR, AUTO)
        except DeviceError:
            return  # a link that is lost moves nothing

    async def close(self) -> None:
        """Release the link; never raises."""
        await self._link.close()

    # ------------------------------------------------------------ answers

    async def _asked(self, rpc: Rpc, *values: float) -> Answer:
        answer = await self._link.request(rpc, *values)
        self._refuse_unless(answer, {Rc.OK})
        return answer

    async def _aimed(self, rpc: Rpc, *values: float) -> None:
        """Turn and aim; raises NoTarget."""
        answer = await self._link.request(rpc, *values, wait_s=self._settings.turn_s / self._scale)
        if answer.code in LOST:
            raise NoTarget(
                f"no prism was found: {in_words(answer.code)}",
                device=self._link.device,
                remedy="See that the prism is there and the line of sight is free",
            )
        self._refuse_unless(answer, {Rc.OK})
        self._locked = True

    def _refuse_unless(self, answer: Answer, good: "set[Rc] | frozenset[Rc]") -> None:
        if answer.code not in good:
            raise Refused(
                f"the instrument answers {in_words(answer.code)}",
                device=self._link.device,
                remedy="See what the instrument shows on its own screen, then measure again.",
                code=answer.code,
            )

    def _say(self, error: DeviceError) -> None:
        for callback in self._alarms:
            callback(Alarm(self._link.device, error.what, error.remedy, fault=True))


def _point(device: str, horizontal: float, vertical: float, distance_m: float) -> Vector:
    """The prism (mm) by angles (rad) of either face and a slope distance.

    Raises ProtocolError for angles and distances that cannot be.
    """
    plausible.between((horizontal, vertical), -TURN, TURN, "angle", device)
    plausible.between((distance_m,), NEAREST_M, 1e-3 * plausible.SURVEYED_MM, "distance", device)
    level = 1e3 * distance_m * math.sin(vertical)
    return (
        level * math.sin(horizontal),
        level * math.cos(horizontal),
        1e3 * distance_m * math.cos(vertical),
    )
