"""A gauge of lines: it is listened to, or asked, for one number at a time."""

import asyncio
import statistics
from dataclasses import dataclass

from drivers.errors import DeviceError, LinkError, NoNumber, NotReady
from drivers.interface import Alarm, GaugeCan, GaugeReading, Identity
from drivers.lines.heard import Heard
from drivers.lines.number import Number, NumberPattern
from drivers.lines.source import Source

LEAST_SAMPLES = 3
"""Lines of a stream that make a dwell at least."""
STRAY, STRAY_LEAST = 30.0, 0.1
"""As for a tracker of lines; mm, or rad."""
NOISE = 2
"""Lines without a number that a stream may send in a row: noise on the wire."""


@dataclass(frozen=True)
class GaugeSettings:
    """How a gauge of lines is used.

    Attributes
    ----------
    each : "sample", "reading" or "key"
        Lines come all the time, and a reading is the mean of a dwell; a line is an answer to
        ``ask``; somebody makes each line by pressing a key.
    ask : str
        What is sent for a reading; "" for nothing.
    silence_s : float
        Seconds without a line that are a fault: of a stream at any time, else of a reading.
    """

    each: str
    ask: str
    silence_s: float


class LineGauge(Heard[Number]):
    """An instrument of one number that sends lines (a :class:`drivers.interface.Gauge`)."""

    def __init__(
        self, source: Source, pattern: NumberPattern, settings: GaugeSettings, device: str,
        time_scale: float = 1.0,
    ) -> None:  # fmt: skip
        self.identity = Identity("lines")
        self._stream = settings.each == "sample"
        self.can = GaugeCan(repeats=settings.each != "key")
        self._numbers, self._settings = pattern, settings
        self._scale, self._unit = time_scale, ""
        super().__init__(source, pattern, settings.silence_s, self._stream, device)

    async def first_line(self) -> None:
        """Wait for a stream to begin; raises Silence, LinkLost."""
        if self._stream:
            with self._lines.queue() as heard:
                said = await heard.get()
            if isinstance(said, LinkError):
                raise said

    async def read(self, dwell_s: float) -> GaugeReading:
        """The mean of the lines of a dwell, the answer to a question, or the next line.

        Raises
        ------
        NoNumber
            For a line without one; of a stream, for several in a row.
        Silence, LinkLost
        """
        with self._lines.queue() as heard:
            if self._stream:
                return self._mean(await self._dwell(heard, dwell_s / self._scale))
            await self._lines.ask(self._settings.ask)
            said = await self._lines.next(heard)
        return GaugeReading(said.value, said.line)

    async def _dwell(
        self, heard: "asyncio.Queue[Number | DeviceError]", wall_s: float
    ) -> list[Number]:
        loop = asyncio.get_running_loop()
        end, without = loop.time() + wall_s, 0
        samples: list[Number] = []
        while loop.time() < end or len(samples) < LEAST_SAMPLES:
            try:
                samples.append(await self._lines.next(heard))
                without = 0
            except NoNumber:
                without += 1
                if without > NOISE:
                    raise
        return samples

    def _mean(self, samples: list[Number]) -> GaugeReading:
        centre = statistics.median(one.value for one in samples)
        off = [abs(one.value - centre) for one in samples]
        if max(off) > max(STRAY * statistics.median(off), STRAY_LEAST):
            raise NotReady(
                f"one of the {len(samples)} lines of a dwell is {max(off):.3g} from the others",
                device=self._device,
                remedy="Keep off the gauge; check the cable, these lines have no checksum",
            )
        return GaugeReading(statistics.fmean(one.value for one in samples), samples[-1].line)

    def _said(self, line: str) -> "Number | DeviceError":
        number = self._numbers.read(line)
        if number is None:
            return self._nothing_in(
                line, "holds no number",
                "It is out of its range, or pattern or unit in the site file does not fit",
            )  # fmt: skip
        if self._unit and number.unit != self._unit:
            self._lines.say(
                Alarm(
                    self._device, f"its lines are in {number.unit} now, before in {self._unit}",
                    "They are read so; see whether somebody has switched the unit",
                )
            )  # fmt: skip
        self._unit = number.unit
        return number
