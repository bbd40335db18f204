"""The measurement that runs on the mock tracker: one dwell, or the continuous mode."""

import asyncio
from typing import TYPE_CHECKING

import numpy as np

from drivers.emscon import wire
from drivers.emscon.codes import Event, MeasurementMode, PacketType, Status
from mocks.physics.pose import Array
from mocks.tracker.sensor import Dwell

if TYPE_CHECKING:
    from mocks.tracker.instrument import Instrument

TICK_WALL_S = 0.004
MOST_RECORDS = 400
MOST_SCATTER_MM = 0.1


class Measuring:
    """Runs measurements as tasks; an interruption ends them without a result."""

    def __init__(self, instrument: "Instrument") -> None:
        self._instrument = instrument
        self._task: asyncio.Task[None] | None = None
        self.last_point: Array | None = None
        self.break_next: tuple[float, float | None] | None = None
        """Break the beam in the next dwell: at this fraction of it, for so many machine s."""

    @property
    def running(self) -> bool:
        """Whether a measurement is under way."""
        return self._task is not None and not self._task.done()

    def start(self, smr: str) -> None:
        """Begin to measure ``smr`` in the mode that is set."""
        mode = self._instrument.settings["MeasurementMode"]["mode"]
        if mode == int(MeasurementMode.STATIONARY):
            self._task = asyncio.create_task(self._stationary(smr))
        else:
            self._task = asyncio.create_task(self._continuous(smr))

    def interrupt(self) -> None:
        """End the measurement without a result."""
        if self._task is not None:
            self._task.cancel()
            self._task = None

    async def _stationary(self, smr: str) -> None:
        instrument = self._instrument
        duration = 1e-3 * int(instrument.settings["StationaryModeParams"]["time_ms"])
        start = instrument.clock.now()
        if self.break_next is not None:
            (fraction, for_s), self.break_next = self.break_next, None
            await instrument.takes(fraction * duration)
            self._break_later(for_s)
            return
        await instrument.takes(duration)
        dwell = instrument.sensor.dwell(smr, start, start + duration)
        if "tracker-no-result" in instrument.world.faults:
            return
        status = Status.OK
        unstable = "tracker-result-unstable" in instrument.world.faults
        if unstable or float(np.max(dwell.scatter)) > MOST_SCATTER_MM:
            status = Status.NO_STATIONARY_RESULT
        self.last_point = dwell.xyz
        self._task = None
        instrument.send(self._packet(dwell, status))

    def _break_later(self, for_s: float | None) -> None:
        """Break the beam from outside this task, and free it after ``for_s`` if given."""
        instrument, loop = self._instrument, asyncio.get_running_loop()
        loop.call_soon(instrument.break_beam)
        if for_s is not None:
            loop.call_later(instrument.clock.wall(for_s), instrument.restore_beam)

    def _packet(self, dwell: Dwell, status: int) -> bytes:
        instrument, units = self._instrument, self._instrument.units
        point = units.point(dwell.xyz)
        std = units.covariance(dwell.xyz, dwell.sample_cov)
        mean = units.covariance(dwell.xyz, dwell.cov)
        values: dict[str, wire.Value] = {
            "mode": 0, "try_mode": 0, "pointing_h": 0.0, "pointing_v": 0.0, "pointing_d": 0.0,
            "std_total": float(np.sqrt(np.trace(std))),
            "apriori_total": float(np.sqrt(np.trace(mean))),
            **instrument.weather(),
        }  # fmt: skip
        for i in range(3):
            values[f"val{i + 1}"] = float(point[i])
            values[f"std{i + 1}"] = float(np.sqrt(std[i, i]))
            values[f"apriori{i + 1}"] = float(np.sqrt(mean[i, i]))
        kind = PacketType.SINGLE_RESULT
        if instrument.settings["StatisticMode"]["stationary"]:
            kind = PacketType.SINGLE_RESULT_2
            for i, j in ((0, 1), (0, 2), (1, 2)):
                values[f"covar{i + 1}{j + 1}"] = float(std[i, j])
                values[f"apriori_covar{i + 1}{j + 1}"] = float(mean[i, j])
        return wire.data(kind, status, **values)

    async def _continuous(self, smr: str) -> None:
        instrument = self._instrument
        params = instrument.settings["ContinuousTimeModeParams"]
        separation, wanted = 1e-3 * int(params["separation_ms"]), int(params["points"])
        first, sent = instrument.clock.now(), 0
        wait = max(TICK_WALL_S, instrument.clock.wall(separation))
        while wanted == 0 or sent < wanted:
            await asyncio.sleep(wait)
            due = int((instrument.clock.now() - first) / separation)
            due = min(due, wanted) if wanted else due
            while sent < due:
                count = min(due - sent, MOST_RECORDS)
                times = np.asarray(first + separation * (np.arange(sent, sent + count) + 1.0))
                instrument.send(self._records(smr, times))
                sent += count
        self._task = None
        instrument.event(Event.COUNT_REACHED)

    def _records(self, smr: str, times: Array) -> bytes:
        instrument = self._instrument
        points = instrument.sensor.samples(smr, times)
        self.last_point = points[-1]
        records: list[dict[str, wire.Value]] = []
        for time, xyz in zip(times, points, strict=True):
            values = instrument.units.point(xyz)
            seconds = int(time)
            records.append(
                {
                    "status": 0,
                    "seconds": seconds,
                    "microseconds": int(1e6 * (time - seconds)),
                    "val1": float(values[0]),
                    "val2": float(values[1]),
                    "val3": float(values[2]),
                }
            )
        air = {name: float(value) for name, value in instrument.weather().items()}
        return wire.multi_result(records, int(MeasurementMode.CONTINUOUS_TIME), **air)
