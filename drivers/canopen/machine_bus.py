"""All nodes of one machine: recognised, configured, watched, halted and left together."""

import asyncio
import struct
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path

from drivers.canopen.drive402 import (
    DISABLE_VOLTAGE,
    QUICK_STOP,
    STATUSWORD,
    Drive402,
    drive_fault,
    state_name,
)
from drivers.canopen.eds import drive_eds_path
from drivers.canopen.layout import Layout
from drivers.canopen.link import CanLink, Device
from drivers.canopen.motion import STOP, MotionChannel
from drivers.canopen.recognise import check_limits, check_serial, read_identity
from drivers.errors import ConnectFailed, DeviceError, HeartbeatLost, LinkError, Silence
from drivers.interface import Alarm, Identity

FIRST_HEARTBEAT_S = 2.0
FAREWELL_DEADLINE_S = 1.0


class MachineBus:
    """The controller node and its drives (nodes 1, 2, ...) on an open link.

    Every EMCY and every new fault becomes an :class:`Alarm` for ``callbacks``; faults stand in
    ``link.faults`` until :meth:`clear`. A lost heartbeat stops the machine at once.
    """

    def __init__(self, link: CanLink, layout: Layout, node_id: int, eds: Path) -> None:
        self.link = link
        self.layout = layout
        self.controller = link.add_device(node_id, eds, f"controller (node {node_id})")
        self.drives: list[Drive402] = []
        drive_eds = drive_eds_path(layout.machine)
        for number, name in enumerate(layout.actuators, start=1):
            device = link.add_device(number, drive_eds, f"drive {name} (node {number})")
            self.drives.append(Drive402(device, name))
        self.devices: list[Device] = [self.controller, *(drive.remote for drive in self.drives)]
        self.motion = MotionChannel(self.controller, layout)
        self.callbacks: list[Callable[[Alarm], None]] = []
        self._halting: asyncio.Future[None] | None = None
        link.on_fault = self._on_fault
        link.on_emergency = self._on_emergency

    async def recognise(
        self, serial: str | None, limits: Mapping[str, tuple[float, float]]
    ) -> Identity:
        """Return who answers; raises ConnectFailed or Refused (see recognise.py)."""
        controller = self.controller
        try:
            identity = await controller.call(lambda: read_identity(controller, self.layout))
        except Silence as error:
            raise ConnectFailed(
                f"the adapter answers, {controller.label} does not",
                device=self.link.name,
                remedy="Check that the controller is switched on, its node number and bit rate.",
            ) from error
        check_serial(identity, serial, controller.label)
        await controller.call(lambda: check_limits(controller, self.layout, limits))
        return identity

    async def watch(self) -> None:
        """Configure both heartbeats, set all nodes OPERATIONAL and hear each of them once.

        Raises ConnectFailed for a node that does not answer or sends no heartbeat.
        """
        address = self.link.address
        producer = struct.pack("<H", round(address.heartbeat_s * 1000))
        consumer = struct.pack("<I", address.pc_node << 16 | round(address.silence_s * 1000))

        def configure(device: Device) -> None:
            device.download(0x1017, 0, producer)
            device.download(0x1016, 1, consumer)

        begin = time.monotonic()
        try:
            for device in self.devices:
                await device.call(partial(configure, device))
        except Silence as error:
            raise ConnectFailed(error.what, device=error.device, remedy=error.remedy) from error
        # A consumer begins to watch with the first heartbeat that it hears: give it one now, or
        # this PC could enable the machine and die unnoticed.
        await self.link.send_heartbeat()
        await self.link.operational()
        deadline = begin + address.silence_s + FIRST_HEARTBEAT_S
        while missing := [d for d in self.devices if not self.link.heard_since(d.id, begin)]:
            if time.monotonic() > deadline:
                names = ", ".join(device.label for device in missing)
                raise ConnectFailed(
                    f"no heartbeat from {names}",
                    device=self.link.name,
                    remedy="Check that all devices are switched on.",
                )
            await asyncio.sleep(0.01)
        await self.motion.synchronise()

    async def note_faults(self) -> None:
        """Latch the faults that drives are in already."""
        for drive in self.drives:
            if state_name(await drive.read(STATUSWORD)) == "fault":
                self._latch_drive(drive.remote.id, await drive.read(0x603F))

    async def clear(self) -> None:
        """Reset all faults; raises the one that stays."""
        self.link.clear_faults()
        self.link.check()
        # A node that was switched off meanwhile has forgotten whom it watches.
        await self.watch()
        for drive in self.drives:
            await drive.clear_fault()
            self.link.unlatch(f"drive {drive.remote.id}")
        self.link.check()

    # ------------------------------------------------------------ what comes unasked

    def alarm(self, alarm: Alarm) -> None:
        """Tell everyone who wants to know."""
        for callback in self.callbacks:
            callback(alarm)

    def _on_fault(self, fault: DeviceError) -> None:
        if isinstance(fault, HeartbeatLost):
            # A machine with a deaf limb must not go on, whatever the program is doing.
            self._halting = asyncio.ensure_future(self._halt())
        self.alarm(Alarm(fault.device, fault.what, fault.remedy, fault=True))
        self.motion.wake()

    def _on_emergency(self, node_id: int, code: int, _register: int) -> None:
        if code == 0:
            self.alarm(Alarm(self.link.label(node_id), "the error is gone"))
        else:
            self._latch_drive(node_id, code)

    def _latch_drive(self, node_id: int, code: int) -> None:
        self.link.latch(f"drive {node_id}", drive_fault(self.link.label(node_id), code))

    # ------------------------------------------------------------ stopping and leaving

    async def _halt(self) -> None:
        try:
            await self.send_stop()
        except LinkError as error:
            self.alarm(Alarm(error.device, f"the stop could not be sent: {error.what}", fault=True))

    async def send_stop(self, controlword: int = QUICK_STOP) -> None:
        """Stop the controller's motion and send ``controlword`` to every drive; raises LinkLost.

        Plain frames: no SDO transfer under way delays them.
        """
        word = struct.pack("<H", controlword)
        drives = [(0x200 + drive.remote.id, word) for drive in self.drives]
        await self.link.send([self.motion.command_frame(STOP), *drives])

    async def leave(self) -> None:
        """Take the power off, let the nodes forget this PC, release the link; never raises."""
        if self.link.closed:
            return
        if "link" not in self.link.faults:
            try:
                await asyncio.wait_for(self._farewell(), FAREWELL_DEADLINE_S)
            except (DeviceError, TimeoutError) as error:
                what = f"closed without a farewell ({error}); the drives stop by themselves"
                self.alarm(Alarm(self.controller.label, what))
        await self.link.close()

    async def _farewell(self) -> None:
        await self.send_stop(DISABLE_VOLTAGE)
        forget = [d.call(partial(d.download, 0x1016, 1, bytes(4))) for d in self.devices]
        await asyncio.gather(*forget)
