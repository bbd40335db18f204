"""The devices of one site, connected: controller, tracker, and whoever carries SMRs."""

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Literal, TypeVar

from app.clock import Clock
from app.files.site import Site
from app.ownership import Ownership
from app.session.events import (
    AlarmRaised,
    Connected,
    DeviceStates,
    Disconnected,
    Observers,
)
from app.session.hands import Carrier, carrier_of
from app.session.links import open_controller, open_gauge, open_tracker
from drivers.errors import ConnectFailed, DeviceError
from drivers.interface import Alarm, Gauge, Identity, MotionController, StopsAtOnce, Tracker

STOP_DEADLINE_S = 3.0
_State = TypeVar("_State")


@dataclass(frozen=True)
class Devices:
    """Both links, open: the controller, and what measures."""

    controller: MotionController
    tracker: Tracker | None = None
    gauge: Gauge | None = None

    @property
    def measuring(self) -> Tracker | Gauge:
        """What measures; raises :class:`ConnectFailed` where nothing does."""
        if (there := self.tracker or self.gauge) is None:
            raise ConnectFailed(
                "nothing that measures is connected", device="tracker", remedy="Connect first"
            )
        return there


class Station:
    """Connects a site's devices, owns the machine meanwhile, and can bring it to a stop.

    Observers of ``observers`` hear of connections, alarms and (from :meth:`poll`) states.
    """

    def __init__(self, site: Site, observers: Observers | None = None) -> None:
        self.site = site
        self.observers = observers or Observers()
        self.clock = Clock(site.clock_scale)
        self.carrier: Carrier = carrier_of(site)
        self.owner = Ownership(f"{site.machine.name} at {site.controller.address}")
        self._owner_by_serial: Ownership | None = None
        self._devices: Devices | None = None
        self._alarm_hooks: list[Callable[[Alarm], None]] = []

    @property
    def connected(self) -> bool:
        """Whether both devices are connected."""
        return self._devices is not None

    @property
    def controller(self) -> MotionController:
        """The motion controller; raises :class:`ConnectFailed` while not connected."""
        return self._need().controller

    @property
    def tracker(self) -> Tracker:
        """The tracker; raises :class:`ConnectFailed` while not connected."""
        if (there := self._need().tracker) is None:
            raise ConnectFailed(
                "no tracker is connected", device="tracker", remedy="This site has a gauge"
            )
        return there

    @property
    def gauge(self) -> Gauge:
        """The gauge; raises :class:`ConnectFailed` while not connected."""
        if (there := self._need().gauge) is None:
            raise ConnectFailed(
                "no gauge is connected", device="gauge", remedy="This site has a tracker"
            )
        return there

    @property
    def measuring(self) -> Tracker | Gauge:
        """What measures; raises :class:`ConnectFailed` while not connected."""
        return self._need().measuring

    @property
    def measures(self) -> Literal["tracker", "gauge"]:
        """What measures at this site."""
        return "tracker" if self.site.gauge is None else "gauge"

    def _need(self) -> Devices:
        if self._devices is None:
            raise ConnectFailed(
                "the devices are not connected", device="station", remedy="Connect first"
            )
        return self._devices

    async def connect(self) -> None:
        """Take the machine and connect to both devices; compare identities with the site file.

        Raises
        ------
        GateRefused
            If another process owns the machine.
        DeviceError
            If a device does not answer, or is not the one that the site file names.
        """
        if self._devices is not None:
            return
        self.owner.take()
        controller: MotionController | None = None
        try:
            self._own_by_serial(self.site.controller.serial)
            controller = await open_controller(self.site)
            self._check_identity("controller", controller.identity, self.site.controller.serial)
            self._own_by_serial(controller.identity.serial)
            self._devices = await self._with_measuring(controller)
        except BaseException:
            if controller is not None:
                await controller.close()
            self._disown()
            raise
        measuring = self._devices.measuring
        for role, device, site in (
            ("controller", controller, self.site.controller),
            (self.measures, measuring, self.site.measured_by),
        ):
            device.on_alarm(self._alarm)
            self.observers.tell(Connected(role, device.identity, site.address))

    async def _with_measuring(self, controller: MotionController) -> Devices:
        """Connect to what measures as well, if it is the one that the site names."""
        by_gauge = self.site.gauge is not None
        devices = (
            Devices(controller, gauge=await open_gauge(self.site))
            if by_gauge
            else Devices(controller, tracker=await open_tracker(self.site))
        )
        try:
            serial = self.site.measured_by.serial
            self._check_identity(self.measures, devices.measuring.identity, serial)
        except DeviceError:
            await devices.measuring.close()
            raise
        return devices

    def _check_identity(self, role: str, identity: Identity, serial: str) -> None:
        if serial and identity.serial != serial:
            raise ConnectFailed(
                f'serial number "{identity.serial}" answers where the site file expects "{serial}"',
                device=role,
                remedy=f"Check the address, or correct the serial of the {role} in "
                f"{self.site.source}",
            )

    def on_alarm(self, hook: Callable[[Alarm], None]) -> Callable[[], None]:
        """Call ``hook`` for each alarm as well (the journal does); returns how to leave."""
        self._alarm_hooks.append(hook)
        return lambda: self._alarm_hooks.remove(hook)

    def _alarm(self, alarm: Alarm) -> None:
        for hook in tuple(self._alarm_hooks):
            hook(alarm)
        self.observers.tell(AlarmRaised(alarm, self.clock.now()))

    def check(self) -> None:
        """Raise the fault that stands at either device, if any."""
        devices = self._need()
        devices.controller.check()
        devices.measuring.check()

    async def poll(self) -> DeviceStates:
        """Ask both devices for their states, tell the observers, and return the answer.

        For screens while no job runs. A device that does not answer is ``None``; why is told as
        an alarm.
        """
        devices = self._need()
        controller = await self._state_of("controller", devices.controller.state)
        tracker = gauge = None
        if devices.tracker is not None:
            tracker = await self._state_of("tracker", devices.tracker.state)
        elif devices.gauge is not None:
            gauge = await self._state_of("gauge", devices.gauge.state)
        states = DeviceStates(controller, tracker, gauge)
        self.observers.tell(states)
        return states

    async def _state_of(self, role: str, ask: Callable[[], Awaitable[_State]]) -> _State | None:
        try:
            return await ask()
        except DeviceError as error:
            self._alarm(Alarm(role, error.what, error.remedy, fault=True))
            return None

    def stop_at_once(self) -> None:
        """Send a stop from any thread, where the controller can; :meth:`safe_stop` follows."""
        devices = self._devices
        if devices is not None and isinstance(devices.controller, StopsAtOnce):
            devices.controller.stop_at_once()

    async def safe_stop(self) -> bool:
        """Stop all motion and any measurement; never raises. Returns whether both confirmed."""
        if self._devices is None:
            return True
        stops = (self._devices.controller.stop, self._devices.measuring.stop)
        confirmed = await asyncio.gather(*(self._stopped(stop) for stop in stops))
        return all(confirmed)

    async def _stopped(self, stop: Callable[[], Awaitable[None]]) -> bool:
        try:
            async with asyncio.timeout(STOP_DEADLINE_S):
                await stop()
        except (DeviceError, TimeoutError, OSError) as error:
            self._alarm(
                Alarm(
                    "stop",
                    f"not confirmed: {error or 'no answer'}",
                    "Use the emergency stop if anything still moves",
                    fault=True,
                )
            )
            return False
        return True

    async def close(self) -> None:
        """Let go of both devices and of the machine."""
        devices, self._devices = self._devices, None
        if devices is not None:
            for role, close in (
                ("controller", devices.controller.close),
                (self.measures, devices.measuring.close),
            ):
                await close()
                self.observers.tell(Disconnected(role))
        self._disown()

    def _own_by_serial(self, serial: str) -> None:
        """Own the machine by what it is, too: its serial number is the same at every address.

        Mocks all have the same; what they are is the station that moves them. Raises GateRefused.
        """
        hands = self.site.hands
        if self._owner_by_serial is not None or not serial:
            return
        where = f"mock {hands.host}:{hands.port}" if hands.kind == "mock" else f"serial {serial}"
        owner = Ownership(f"{self.site.machine.name} with {where}")
        owner.take()
        self._owner_by_serial = owner

    def _disown(self) -> None:
        self.owner.release()
        if self._owner_by_serial is not None:
            self._owner_by_serial.release()
            self._owner_by_serial = None
