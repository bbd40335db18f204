"""The tracker's controller: settings, commands, measurements, events.

One instrument lives as long as its station, whatever connects to it.
"""

import asyncio
from collections.abc import Awaitable, Callable

import numpy as np

from drivers.emscon import wire
from drivers.emscon.codes import (
    UNKNOWN_COMMAND,
    Event,
    LaserStatus,
    ProcessorStatus,
    SensorType,
    Status,
    TrackerStatus,
    WeatherMonitor,
)
from mocks.clock import ScaledClock
from mocks.physics.pose import Array
from mocks.tracker.beam import Beam
from mocks.tracker.measuring import Measuring
from mocks.tracker.sensor import Sensor
from mocks.tracker.settings import (
    CHANGED,
    DEFAULTS,
    NEEDS_INITIALIZE,
    REFLECTORS,
    Values,
    objection,
)
from mocks.tracker.units import Units
from mocks.world import World

INITIALIZE_S = 30.0
SLEW_RAD_S = 3.0
LOCK_S = 0.3
FACE_S = 2.0
SERIAL = 390793
FIRMWARE = (3, 6, 0)
BEAM_BROKEN_STATUS = 10004


class Instrument:
    """A tracker without its network: ``send`` takes the packets that it wants to say."""

    def __init__(self, world: World, clock: ScaledClock) -> None:
        self.world = world
        self.clock = clock
        self.settings = {name: dict(values) for name, values in DEFAULTS.items()}
        self.sensor = Sensor(world)
        self.beam = Beam(world)
        self.send: Callable[[bytes], None] = lambda packet: None
        self.initialized = False
        self.busy = False
        self.last_status = 0
        self.measuring = Measuring(self)
        self._handlers: dict[str, Callable[[Values], Awaitable[None]]] = {
            "GetSystemStatus": self._system_status,
            "GetTrackerStatus": self._tracker_status,
            "Initialize": self._initialize,
            "GetEnvironmentParams": self._environment,
            "GetReflectors": self._reflectors,
            "StartMeasurement": self._start,
            "StopMeasurement": self._stop,
            "ChangeFace": self._change_face,
            "GoBirdBath": self._birdbath,
            "GoBirdBath2": self._birdbath,
            "GoPosition": self._go_position,
            "GoLastMeasuredPoint": self._go_last,
            "FindReflector": self._find,
            "LookForTarget": self._look,
            "GetDirection": self._direction,
            "GetFace": self._face,
            "GetMeasurementStatusInfo": self._measurement_status,
            "GetObjectTemperature": self._object_temperature,
            "GetTrackerInfo": self._tracker_info,
            "GetMeteoStationInfo": self._meteo_info,
        }
        for plain in ("ClearCommandQueue", "Park", "ExitApplication"):
            self._handlers[plain] = self._plain(plain)
        world.smrs.subscribe(self._smr_moved)

    @property
    def units(self) -> Units:
        """The units and coordinates in which this tracker speaks now."""
        return Units(
            self.settings["Units"], int(self.settings["CoordinateSystemType"]["coordinates"])
        )

    async def obey(self, packet: wire.Packet) -> None:
        """Carry out one command and answer it."""
        known = wire.BY_CODE.get(packet.command)
        if known is None:
            self.send(wire.bare_answer(packet.command, Status.NOT_IMPLEMENTED))
            return
        if self.world.faults.take("tracker-not-initialised"):
            self.initialized = False
        name, kind = known.name, known.name[3:]
        if name in NEEDS_INITIALIZE and not self.initialized:
            self.answer(name, Status.NOT_INITIALIZED)
        elif name in self._handlers:
            await self._handlers[name](packet.fields)
        elif name.startswith("Set") and kind in self.settings:
            self._set(name, kind, packet.fields)
        elif name.startswith("Get") and kind in self.settings:
            self.send(wire.answer(name, **self.settings[kind]))
        else:
            self.answer(name, Status.NOT_IMPLEMENTED)

    def answer(self, name: str, status: int = 0) -> None:
        """Answer a command without data."""
        self.last_status = status
        self.send(wire.answer(name, status))

    def event(self, event: Event) -> None:
        """Report a status change."""
        self.send(wire.status_change(event))

    def unsolicited(self, status: int) -> None:
        """An error that belongs to no command; the settings may hide it."""
        if self.settings["SystemSettings"]["send_unsolicited"]:
            self.send(wire.error(UNKNOWN_COMMAND, status))

    async def takes(self, machine_s: float) -> None:
        """Let machine time pass."""
        await asyncio.sleep(self.clock.wall(machine_s))

    def break_beam(self, status: int = BEAM_BROKEN_STATUS) -> None:
        """Somebody steps into the beam."""
        if self.beam.interrupted:
            return
        followed = self.beam.locked is not None
        self.beam.interrupt()
        if followed:
            self.lose(status)

    def lose(self, status: int = BEAM_BROKEN_STATUS) -> None:
        """Say that the SMR is lost; a running measurement ends without a result."""
        self.measuring.interrupt()
        self.event(Event.NOT_READY)
        self.unsolicited(status)

    def restore_beam(self) -> bool:
        """Nobody is in the beam any more; it locks again if the SMR is still there."""
        if not self.beam.interrupted:
            return self.beam.locked is not None
        caught = self.beam.free()
        if caught:
            self.event(Event.READY)
        return caught

    def drop_smr(self) -> None:
        """The SMR is taken out of the beam: nothing is followed any more."""
        if self.beam.locked is not None:
            self.beam.here()
            self.beam.locked = None
            self.lose()

    def _smr_moved(self, smr: str) -> None:
        if smr == self.beam.locked:
            self.measuring.interrupt()  # carried away under a running dwell
            return
        idle = self.beam.locked is None and not self.beam.interrupted and self.initialized
        if idle and self.beam.search(self.beam.aim):
            self.event(Event.READY)

    def _set(self, name: str, kind: str, values: Values) -> None:
        status = objection(kind, values)
        if status == Status.OK:
            self.settings[kind] = dict(values)
            self._apply(kind)
        self.answer(name, status)
        if status == Status.OK and kind in CHANGED:
            self.event(CHANGED[kind])

    def _apply(self, kind: str) -> None:
        if kind == "SearchParams":
            radius = float(self.settings[kind]["radius"])
            self.beam.radius_mm = self.units.to_mm(radius)
        elif kind == "Reflector":
            self.sensor.range_error = REFLECTORS[int(self.settings[kind]["id"])][3]
        computes = self.settings["SystemSettings"]["weather_monitor"] == int(
            WeatherMonitor.READ_AND_COMPUTE
        )
        self.sensor.environment = (
            None if computes else self.units.environment(self.settings["EnvironmentParams"])
        )

    async def _system_status(self, _: Values) -> None:
        cold = "tracker-cold" in self.world.faults
        self.send(
            wire.answer(
                "GetSystemStatus", last_result=self.last_status,
                processor=int(
                    ProcessorStatus.INITIALIZED if self.initialized else ProcessorStatus.BOOTED
                ),
                laser=int(LaserStatus.HEATING if cold else LaserStatus.READY), adm=2,
                major=FIRMWARE[0], minor=FIRMWARE[1], build=FIRMWARE[2],
                weather_monitor=self.settings["SystemSettings"]["weather_monitor"],
                flags=0, serial=SERIAL,
            )
        )  # fmt: skip

    async def _tracker_status(self, _: Values) -> None:
        state = TrackerStatus.READY if self.beam.locked else TrackerStatus.NOT_READY
        if self.busy or self.measuring.running:
            state = TrackerStatus.BUSY
        self.send(wire.answer("GetTrackerStatus", tracker_status=int(state)))

    async def _initialize(self, _: Values) -> None:
        self.busy = True
        self.measuring.interrupt()
        await self.takes(INITIALIZE_S)
        self.initialized, self.busy = True, False
        self.sensor.face = 1
        self.answer("Initialize")
        self.event(Event.INIT_STATUS_CHANGED)
        if self.beam.search(self.beam.aim):
            self.event(Event.READY)

    async def _environment(self, _: Values) -> None:
        if "tracker-no-weather-station" in self.world.faults:
            self.answer("GetEnvironmentParams", Status.NO_WEATHER_MONITOR)
        elif self.settings["SystemSettings"]["weather_monitor"] == int(WeatherMonitor.OFF):
            self.send(wire.answer("GetEnvironmentParams", **self.settings["EnvironmentParams"]))
        else:
            self.send(wire.answer("GetEnvironmentParams", **self.weather()))

    def weather(self) -> dict[str, wire.Value]:
        """The weather station's readings in the present units."""
        return self.units.meteo(self.sensor.air(self.clock.now()))

    async def _reflectors(self, _: Values) -> None:
        for number, (name, kind, offset, _constant) in REFLECTORS.items():
            self.send(
                wire.answer(
                    "GetReflectors", total=len(REFLECTORS), id=number, target_type=int(kind),
                    surface_offset=self.units.from_mm(offset), name=name,
                )
            )  # fmt: skip

    async def _start(self, _: Values) -> None:
        faults = self.world.faults
        status = Status.OK
        if "tracker-cold" in faults:
            status = Status.NOT_WARMED_UP
        elif "tracker-unstable" in faults:
            status = Status.NOT_STABLE
        elif self.measuring.running:
            status = Status.SERVER_BUSY
        elif self.beam.locked is None:
            status = Status.MEAS_STATUS_NOT_READY
        self.answer("StartMeasurement", status)
        if status == Status.OK:
            self.measuring.start(self.beam.locked or "")

    async def _stop(self, _: Values) -> None:
        self.measuring.interrupt()
        self.answer("StopMeasurement")

    async def _slew(self, name: str, aim: Array, radius_mm: float | None = None) -> None:
        self.measuring.interrupt()
        here = self.beam.here()
        cosine = here @ aim / (np.linalg.norm(here) * np.linalg.norm(aim))
        self.beam.locked = None
        self.busy = True
        await self.takes(LOCK_S + float(np.arccos(np.clip(cosine, -1.0, 1.0))) / SLEW_RAD_S)
        self.busy = False
        found = self.beam.search(aim, radius_mm)
        self.answer(name, Status.OK if found else Status.NO_TARGET_FOUND)
        self.event(Event.READY if found else Event.NOT_READY)

    async def _birdbath(self, values: Values) -> None:
        name = "GoBirdBath2" if "clockwise" in values else "GoBirdBath"
        home = self.world.smr_in_tracker("home", np.array([self.clock.now()]))[0]
        await self._slew(name, home)

    async def _go_position(self, values: Values) -> None:
        aim = self.units.point_mm(values)
        if not np.isfinite(aim).all() or np.linalg.norm(aim) < 1.0:
            self.answer("GoPosition", Status.WRONG_PARAMETER)
            return
        self.sensor.face = 1  # "the tracker always switches to face 1 after GoPosition"
        await self._slew("GoPosition", aim)

    async def _go_last(self, _: Values) -> None:
        if self.measuring.last_point is None:
            self.answer("GoLastMeasuredPoint", Status.NO_LAST_POINT)
        else:
            await self._slew("GoLastMeasuredPoint", self.measuring.last_point)

    async def _find(self, _: Values) -> None:
        await self._slew("FindReflector", self.beam.here())

    async def _look(self, values: Values) -> None:
        aim = self.units.point_mm(values)
        await self.takes(LOCK_S)
        found = self.beam.search(aim, self.units.to_mm(float(values["radius"])))
        if not found:
            self.answer("LookForTarget", Status.NO_TARGET_FOUND)
            return
        hz, v = self.units.direction(self.beam.here())
        self.send(wire.answer("LookForTarget", hz=hz, v=v))
        self.event(Event.READY)

    async def _direction(self, _: Values) -> None:
        hz, v = self.units.direction(self.beam.here())
        self.send(wire.answer("GetDirection", hz=hz, v=v))

    async def _change_face(self, _: Values) -> None:
        self.measuring.interrupt()
        self.busy = True
        await self.takes(FACE_S)
        self.busy = False
        self.sensor.face = 3 - self.sensor.face
        found = self.beam.search(self.beam.here())
        self.answer("ChangeFace", Status.OK if found else Status.NO_TARGET_FOUND)
        self.event(Event.FACE_2 if self.sensor.face == 2 else Event.FACE_1)
        self.event(Event.READY if found else Event.NOT_READY)

    async def _face(self, _: Values) -> None:
        self.send(wire.answer("GetFace", face=self.sensor.face))

    async def _measurement_status(self, _: Values) -> None:
        bits = 1 if self.beam.locked else 0
        self.send(wire.answer("GetMeasurementStatusInfo", last_result=self.last_status, bits=bits))

    async def _object_temperature(self, _: Values) -> None:
        if "tracker-no-object-sensor" in self.world.faults:
            self.answer("GetObjectTemperature", Status.NO_WEATHER_MONITOR)
            return
        kelvin_free = self.units.temperature(self.world.structure_temp_C())
        self.send(wire.answer("GetObjectTemperature", temperature=kelvin_free))

    async def _tracker_info(self, _: Values) -> None:
        self.send(
            wire.answer(
                "GetTrackerInfo", sensor_type=int(SensorType.AT901_LR), name="AT901-LR (mock)",
                serial=SERIAL, compensation=1, has_adm=1, has_camera=0, has_nivel=0,
                nivel_offset=0.0, max_distance=self.units.from_mm(80e3),
                min_distance=self.units.from_mm(0.0), max_rate=3000, faces=2,
                hz_range=360.0, v_range=45.0, accuracy_model=1, major=FIRMWARE[0],
                minor=FIRMWARE[1],
            )
        )  # fmt: skip

    async def _meteo_info(self, _: Values) -> None:
        self.send(wire.answer("GetMeteoStationInfo", station_type=1, name="mock", major=1, minor=0))

    def _plain(self, name: str) -> Callable[[Values], Awaitable[None]]:
        async def done(_: Values) -> None:
            self.answer(name)

        return done
