"""Nodes on one link that are watched, and stopped and left together."""

import asyncio
import contextlib
import struct
import time
from collections.abc import Callable
from functools import partial

from drivers.canopen.device import Device
from drivers.canopen.drive402 import (
    DISABLE_VOLTAGE,
    ENABLE,
    QUICK_STOP,
    STATUSWORD,
    Drive402,
    drive_fault,
    state_name,
)
from drivers.canopen.link import CanLink
from drivers.errors import ConnectFailed, DeviceError, HeartbeatLost, LinkLost, Silence
from drivers.interface import Alarm
from drivers.stopping import STILL_MOVING

FIRST_HEARTBEAT_S = 2.0
FAREWELL_DEADLINE_S = 1.0


class Nodes:
    """The nodes of one machine on an open link.

    Every EMCY and every new fault becomes an :class:`Alarm` for ``callbacks``; faults stand in
    ``link.faults`` until :meth:`clear`. A fault that :meth:`must_halt` names stops the machine at
    once.
    """

    def __init__(self, link: CanLink) -> None:
        self.link = link
        self.drives: list[Drive402] = []
        self.devices: list[Device] = []
        self.callbacks: list[Callable[[Alarm], None]] = []
        self._halting: asyncio.Future[None] | None = None
        link.on_fault = self._on_fault
        link.on_emergency = self._on_emergency
        link.on_damaged = self._on_damaged

    async def watch(self) -> None:
        """Configure both heartbeats, set all nodes OPERATIONAL and hear each of them once.

        Raises ConnectFailed for a node that does not answer or sends no heartbeat.
        """
        address = self.link.address
        begin = time.monotonic()
        try:
            for device in self.devices:
                await device.call(partial(self._configure, device))
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
        for drive in self.drives:
            await drive.read_control_pdo()

    def _configure(self, device: Device) -> None:
        """Set both heartbeats of a node; blocking."""
        address = self.link.address
        device.download(0x1017, 0, struct.pack("<H", round(address.heartbeat_s * 1000)))
        watched = address.pc_node << 16 | round(address.silence_s * 1000)
        device.download(0x1016, 1, struct.pack("<I", watched))

    async def note_faults(self) -> None:
        """Latch the faults that drives are in already."""
        for drive in self.drives:
            if state_name(await drive.read(STATUSWORD)) == "fault":
                self.latch_drive(drive.remote.id, await drive.read(0x603F))

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

    def must_halt(self, fault: DeviceError) -> bool:
        """Whether a fault stops the whole machine from here."""
        return isinstance(fault, (HeartbeatLost, LinkLost))

    def wake(self) -> None:
        """Let those who wait look again."""

    def _on_fault(self, fault: DeviceError) -> None:
        if self.must_halt(fault):
            # A machine with a deaf limb must not go on, whatever the program is doing.
            self._halting = asyncio.ensure_future(self._halt())
        self.alarm(Alarm(fault.device, fault.what, fault.remedy, fault=True))
        self.wake()

    def _on_emergency(self, node_id: int, code: int, _register: int) -> None:
        if code == 0:
            self.alarm(Alarm(self.link.label(node_id), "the error is gone"))
        else:
            self.latch_drive(node_id, code)

    def _on_damaged(self, count: int, what: str) -> None:
        remedy = "Check cable, shield and earth of the adapter, if there are more of them."
        ignored = (
            f"{count} damaged frame{'s' if count > 1 else ''} ignored so far; the last: {what}"
        )
        self.alarm(Alarm(self.link.name, ignored, remedy))

    def latch_drive(self, node_id: int, code: int) -> None:
        """Let the fault of a drive stand."""
        self.link.latch(f"drive {node_id}", drive_fault(self.link.label(node_id), code))

    # ------------------------------------------------------------ stopping and leaving

    async def _halt(self) -> None:
        try:
            await self.send_stop()
        except DeviceError as error:
            if "link" in self.link.faults:
                return  # which says that the machine stops by itself
            what = f"the stop could not be sent: {error.what}"
            self.alarm(Alarm(error.device, what, STILL_MOVING, fault=True))

    async def send_stop(self, controlword: int = QUICK_STOP) -> None:
        """Send ``controlword`` to every drive; raises LinkLost.

        Plain frames, each as long as the drive's own mapping: no SDO transfer under way delays
        them. A drive that takes its controlword by SDO alone is told so.
        """
        await self.send_controlword(controlword)

    def stop_at_once(self) -> None:
        """Send a quick stop to every drive that takes it as a frame; any thread, never raises."""
        for drive in self.drives:
            drive.stopped = True
        frames = [drive.control_frame(QUICK_STOP) for drive in self.drives]
        with contextlib.suppress(DeviceError):
            self.link.send_now([frame for frame in frames if frame is not None])

    async def send_controlword(
        self, controlword: int, before: tuple[tuple[int, bytes], ...] = ()
    ) -> None:
        """Send frames ``before``, then a controlword to all drives, back to back.

        After one that takes the power off nothing that is still under way gives it again.
        """
        if controlword & ENABLE != ENABLE:
            for drive in self.drives:
                drive.stopped = True
        frames = [drive.control_frame(controlword) for drive in self.drives]
        await self.link.send([*before, *(frame for frame in frames if frame is not None)])
        by_sdo = [d for d, frame in zip(self.drives, frames, strict=True) if frame is None]
        await asyncio.gather(*(drive.write(0x6040, controlword) for drive in by_sdo))

    async def leave(self) -> None:
        """Take the power off, let the nodes forget this PC, release the link; never raises."""
        if self.link.closed:
            return
        if "link" not in self.link.faults:
            try:
                await asyncio.wait_for(self.farewell(), FAREWELL_DEADLINE_S)
            except (DeviceError, TimeoutError) as error:
                what = f"closed without a farewell ({error}); the drives stop by themselves"
                self.alarm(Alarm(self.devices[0].label, what))
        await self.link.close()

    async def farewell(self) -> None:
        """Take the power off, and let the nodes forget this PC."""
        await self.send_stop(DISABLE_VOLTAGE)
        forget = [d.call(partial(d.download, 0x1016, 1, bytes(4))) for d in self.devices]
        await asyncio.gather(*forget)
