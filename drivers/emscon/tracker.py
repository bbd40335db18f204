"""A laser tracker behind the emScon TPI, as the routines see it."""

import asyncio
from collections.abc import AsyncIterator, Callable
from dataclasses import replace

from drivers.emscon import wire
from drivers.emscon.codes import (
    Event,
    LaserStatus,
    MeasurementMode,
    PacketType,
    ProcessorStatus,
    Status,
    TrackerStatus,
    WeatherMonitor,
    status_words,
)
from drivers.emscon.link import EmsconLink
from drivers.emscon.measurement import Measurement, refusal
from drivers.emscon.results import reading, samples
from drivers.emscon.setting_up import identify, set_up
from drivers.emscon.settings import EmsconSettings
from drivers.emscon.weather import channels_of, lacks_object_sensor, require_weather
from drivers.errors import BeamBroken, DeviceError, LinkLost, NoTarget, Refused, Silence
from drivers.interface import (
    Alarm,
    Identity,
    TrackerCan,
    TrackerReading,
    TrackerState,
    TrackSample,
)
from drivers.stopping import stopped

POINT_S = 60.0
LONGEST_PACKET_GAP_S = 1.0


class EmsconTracker:
    """Laser tracker of the AT901/AT40x generations (implements ``drivers.interface.Tracker``).

    Not affiliated with the maker; untested on hardware.

    Parameters
    ----------
    link : EmsconLink
        An open connection; see :meth:`connect`.
    time_scale : float
        Machine seconds per wall second, 1 except with a mock. Deadlines use it; the device is
        always told device time.
    """

    def __init__(
        self, link: EmsconLink, time_scale: float = 1.0, settings: EmsconSettings | None = None
    ) -> None:
        self.identity = Identity("emscon")
        self._link = link
        self._scale = time_scale
        self._settings = settings or EmsconSettings()
        self.can = TrackerCan(
            points=True,
            searches=True,
            faces=True,
            streams=True,
            reflectors=True,
            weather=self._settings.weather_monitor != WeatherMonitor.OFF,
            object_temperature=self._settings.object_sensor is not False,
        )
        self._alarms: list[Callable[[Alarm], None]] = []
        self._names: dict[int, str] = {}
        self._cached: dict[str, dict[str, wire.Value]] = {}
        self._measurement: Measurement | None = None
        self._activity = asyncio.Lock()
        self._pointing = False
        self._locked = False
        self._fault: DeviceError | None = None
        link.listen(self._hear, self._link_lost)

    @classmethod
    async def connect(
        cls,
        address: str,
        time_scale: float = 1.0,
        settings: EmsconSettings | None = None,
        timeout: float = 5.0,
    ) -> "EmsconTracker":
        """Connect to ``"host:port"`` (port 700 by default) and ask who answers.

        Raises ConnectFailed, Silence, ProtocolError.
        """
        host, _, port = address.rpartition(":")
        link = await EmsconLink.open(host or port, int(port) if host else 700, timeout)
        tracker = cls(link, time_scale, settings)
        try:
            tracker.identity = await identify(tracker._ask)
        except BaseException:
            await tracker.close()
            raise
        return tracker

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """Call ``callback`` in the event loop for everything said unasked."""
        self._alarms.append(callback)

    def check(self) -> None:
        """Raise the fault that is standing: the link, or the sensor disconnected."""
        if self._link.lost is not None:
            raise self._link.lost
        if self._fault is not None:
            raise self._fault

    async def state(self) -> TrackerState:
        """Read a snapshot."""
        system = await self._ask("GetSystemStatus")
        status = (await self._ask("GetTrackerStatus")).integer("tracker_status")
        face = (await self._ask("GetFace")).integer("face")
        try:
            reflector = (await self._ask("GetReflector")).integer("id")
        except Refused:
            reflector = -1  # none is selected yet
        initialized = system.integer("processor") == ProcessorStatus.INITIALIZED
        ready = status == TrackerStatus.READY
        return TrackerState(
            initialized=initialized,
            ready=initialized and ready,
            locked=self._locked if status == TrackerStatus.BUSY else ready,
            laser_warm=system.integer("laser") == LaserStatus.READY,
            reflector=self._names.get(reflector, ""),
            face=face,
        )

    async def initialize(self) -> None:
        """Set units, frame, weather and statistics; initialise the tracker if it is not yet.

        Raises NotReady, Refused, Silence, LinkLost.
        """
        self._cached.clear()
        await set_up(self._ask, self._settings)
        await self.reflectors()
        if self.can.weather:
            await require_weather(self._ask, self._link.device)
        if self._settings.object_sensor is None:
            self.can = replace(self.can, object_temperature=await self._has_object_sensor())

    async def _has_object_sensor(self) -> bool:
        why = await lacks_object_sensor(self._ask)
        if why:
            what = f"no sensor of the object's temperature ({why})"
            remedy = "Connect one, or measure without: thermal growth then stays unseen."
            self._say(Alarm(self._link.device, what, remedy))
        return not why

    async def reflectors(self) -> dict[str, int]:
        """Name and identifier of every reflector that the tracker knows."""
        packets = await self._link.ask_many("GetReflectors", self._settings.margin_s)
        known = [p for p in packets if p.integer("total") > 0]
        self._names = {p.integer("id"): p.text("name") for p in known}
        return {name: number for number, name in self._names.items()}

    async def select_reflector(self, name: str) -> None:
        """Choose the reflector type; raises Refused if the tracker does not know it."""
        known = await self.reflectors()
        if name not in known:
            raise Refused(
                f'it knows no reflector "{name}"',
                device=self._link.device,
                remedy=f"Choose one of: {', '.join(sorted(known))}.",
            )
        await self._ask("SetReflector", id=known[name])

    async def point_at(self, xyz: tuple[float, float, float]) -> None:
        """Drive the beam to a point (tracker frame, mm) and lock there; raises NoTarget."""
        x, y, z = xyz
        await self._point("GoPosition", x=x, y=y, z=z, use_adm=1)

    async def find_reflector(self, distance_mm: float) -> None:
        """Search around the present direction; raises NoTarget."""
        await self._point("FindReflector", distance=distance_mm)

    async def go_birdbath(self) -> None:
        """Drive the beam to the home reflector; raises NoTarget."""
        await self._point("GoBirdBath")

    async def change_face(self) -> None:
        """Turn to the other face; the beam locks on the same reflector again."""
        await self._point("ChangeFace")

    async def measure(self, dwell_s: float) -> TrackerReading:
        """Measure stationary for ``dwell_s`` of device time.

        Raises BeamBroken when no reading was made because the beam was interrupted or the result
        never came, NotReady when the tracker is not initialised, warm or stable.
        """
        async with self._activity:
            await self._set("SetMeasurementMode", mode=MeasurementMode.STATIONARY)
            await self._set("SetStationaryModeParams", time_ms=round(1000 * dwell_s), use_adm=1)
            measurement = self._measurement = Measurement(self._link.device)
            try:
                await self._ask("StartMeasurement")
                deadline = dwell_s / self._scale + self._settings.margin_s
                try:
                    async with asyncio.timeout(deadline):
                        packet = await measurement.next()
                        return reading(packet, self._link.device, weather=self.can.weather)
                except TimeoutError as error:
                    raise BeamBroken(
                        f"the result did not come within {deadline:.1f} s",
                        device=self._link.device,
                        remedy="Check the beam, lock on the reflector and measure again.",
                    ) from error
            except BaseException:
                await self._abort()
                raise
            finally:
                self._measurement = None

    async def stream(self, separation_s: float) -> AsyncIterator[TrackSample]:
        """Yield continuous-mode samples until the iterator is closed; raises BeamBroken."""
        async with self._activity:
            await self._set("SetMeasurementMode", mode=MeasurementMode.CONTINUOUS_TIME)
            await self._set(
                "SetContinuousTimeModeParams",
                separation_ms=max(round(1000 * separation_s), 1),
                points=0,
                use_region=0,
                region_type=0,
            )
            measurement = self._measurement = Measurement(self._link.device)
            gap = max(separation_s, LONGEST_PACKET_GAP_S) / self._scale + self._settings.margin_s
            try:
                await self._ask("StartMeasurement")
                while True:
                    try:
                        async with asyncio.timeout(gap):
                            packet = await measurement.next()
                    except TimeoutError as error:
                        raise BeamBroken(
                            f"no sample within {gap:.1f} s",
                            device=self._link.device,
                            remedy="Check the beam and lock on the reflector.",
                        ) from error
                    for sample in samples(packet, self._link.device):
                        yield sample
            finally:
                await self._abort()
                self._measurement = None

    async def channels(self) -> dict[str, float]:
        """What it measures of object and air: deg C, hPa, relative humidity in %."""
        return await channels_of(self._ask, self.can, self._link.device)

    async def stop(self) -> None:
        """End any measurement; never raises for a second call."""
        if self._measurement is not None:
            self._measurement.fail(stopped(BeamBroken, self._link.device))
            await self._abort()

    async def close(self) -> None:
        """Release the link; never raises."""
        if self._measurement is not None:
            closed = LinkLost(
                "the connection was closed", device=self._link.device, remedy="Connect again."
            )
            self._measurement.fail(closed)
        await self._link.close()

    async def _ask(self, name: str, device_s: float = 0.0, /, **values: wire.Value) -> wire.Packet:
        """Exchange that may take ``device_s`` of device time; statuses become typed errors."""
        try:
            return await self._link.ask(
                name, device_s / self._scale + self._settings.margin_s, **values
            )
        except Refused as error:
            raise refusal(error, self._link.device) from error

    async def _set(self, name: str, **values: wire.Value) -> None:
        """Send a setting only if it differs from what the tracker already has."""
        if self._cached.get(name) != values:
            await self._ask(name, **values)
            self._cached[name] = values

    async def _point(self, name: str, **values: wire.Value) -> None:
        async with self._activity:
            self._pointing = True
            self._locked = False
            try:
                await self._ask(name, POINT_S, **values)
                self._locked = True
            except BeamBroken as error:
                raise NoTarget(error.what, device=self._link.device, remedy=error.remedy) from error
            finally:
                self._pointing = False

    async def _abort(self) -> None:
        """Leave no measurement running, so that no late result meets the next one."""
        try:
            if self._link.lost is None:
                await self._ask("StopMeasurement")
        except DeviceError as error:
            self._say(Alarm(self._link.device, f"stopping the measurement failed: {error.what}"))

    def _hear(self, packet: wire.Packet) -> None:
        """Every packet passes here, in the reader's task, in the order of arrival."""
        if self._measurement is not None:
            self._measurement.hear(packet)
        elif packet.type in (PacketType.SINGLE_RESULT, PacketType.SINGLE_RESULT_2):
            self._say(Alarm(self._link.device, "a result came that nobody waits for; ignored"))
        if packet.type == PacketType.STATUS_CHANGE:
            self._hear_event(packet.event)
        elif packet.type == PacketType.ERROR:
            what = f"error said unasked: {status_words(packet.status)}"
            if packet.status == Status.NOT_INITIALIZED:
                self._cached.clear()
            self._say(Alarm(self._link.device, what))

    def _hear_event(self, event: int) -> None:
        device = self._link.device
        if event == Event.NOT_READY:
            was_locked, self._locked = self._locked, False
            if was_locked and not self._pointing:
                self._say(Alarm(device, "the beam is broken", "Clear the line of sight."))
        elif event == Event.READY:
            self._locked = True
        elif event == Event.INIT_STATUS_CHANGED:
            self._cached.clear()
        elif event == Event.SENSOR_DETECTED:
            self._fault = None
        elif event in (Event.SENSOR_DISCONNECTED, Event.PROCESSOR_CLOSING, Event.SERVER_CLOSING):
            what = {Event.SENSOR_DISCONNECTED: "the sensor is disconnected"}.get(
                Event(event), "the tracker's server is closing"
            )
            self._fault = LinkLost(what, device=device, remedy="Check the tracker's controller.")
            self._say(Alarm(device, what, self._fault.remedy, fault=True))

    def _link_lost(self, error: DeviceError) -> None:
        self._locked = False
        if self._measurement is not None:
            self._measurement.fail(error)
        kind = "silent" if isinstance(error, Silence) else "gone"
        self._say(Alarm(self._link.device, f"{kind}: {error.what}", error.remedy, fault=True))

    def _say(self, alarm: Alarm) -> None:
        for callback in self._alarms:
            callback(alarm)
