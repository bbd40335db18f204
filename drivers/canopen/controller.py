"""A motion controller and its drives on CANopen.

:class:`CanopenController` is a :class:`drivers.interface.MotionController`. What the machine is
follows from the controller's EDS file. Objects, PDOs and numbers: docs/protocols/canopen.md.
"""

import asyncio
import math
import struct
import time
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TypeVar

from drivers.canopen import layout as at
from drivers.canopen.drive402 import (
    DISABLE_VOLTAGE,
    QUICK_STOP,
    REFERENCED,
    STATUSWORD,
    Drive402,
    drive_fault,
    state_name,
)
from drivers.canopen.eds import eds_path
from drivers.canopen.layout import Layout, read_layout
from drivers.canopen.link import BusAddress, CanLink, Device
from drivers.canopen.motion import MOVE_TO_POSE, MOVE_TO_Q, PREPARE, STOP, MotionChannel
from drivers.canopen.parameter_access import ParameterAccess
from drivers.canopen.recognise import check_limits, check_serial, read_identity
from drivers.errors import (
    ConnectFailed,
    DeviceError,
    DeviceFault,
    LinkError,
    Refused,
    Silence,
)
from drivers.interface import ActuatorState, Alarm, ControllerState, Identity

T = TypeVar("T")
ANSWER_DEADLINE_S = 2.0
SINGLE_MOTION_DEADLINE_S = 60.0


class CanopenController:
    """The controller node with its drives; made by :meth:`connect`.

    Alarms come for every EMCY and every fault that :meth:`check` would raise. Faults stand until
    :meth:`clear_faults`; after a lost link only a new :meth:`connect` helps.
    """

    def __init__(self, link: CanLink, layout: Layout, node_id: int, eds: Path) -> None:
        self.identity = Identity("canopen-controller")
        self.layout = layout
        self._link = link
        self._controller = link.add_device(node_id, eds, f"controller (node {node_id})")
        self._device = self._controller.label
        self._drives = []
        drive_eds = eds_path("drive402")
        for number, name in enumerate(layout.actuators, start=1):
            device = link.add_device(number, drive_eds, f"drive {name} (node {number})")
            self._drives.append(Drive402(device, name))
        self._devices = [self._controller, *(drive.remote for drive in self._drives)]
        self._motion = MotionChannel(self._controller, layout)
        self._parameters = ParameterAccess(self._controller, layout)
        self._callbacks: list[Callable[[Alarm], None]] = []
        self._stopped = False
        link.on_fault = self._on_fault
        link.on_emergency = self._on_emergency

    # ------------------------------------------------------------ connecting

    @classmethod
    async def connect(
        cls,
        interface: str = "slcan",
        channel: str = "",
        bitrate: int | None = None,
        *,
        machine: str = "hexapod",
        node_id: int = 10,
        eds: Path | None = None,
        serial: str | None = None,
        limits: Mapping[str, tuple[float, float]] | None = None,
        heartbeat_s: float = 0.1,
        silence_s: float = 1.0,
    ) -> "CanopenController":
        """Open the bus, recognise the controller and watch all nodes. Nothing moves.

        Parameters
        ----------
        interface, channel, bitrate
            As in python-can: ``"slcan"``, ``"socket://127.0.0.1:4001"`` or ``"COM3"``;
            ``"socketcan"``, ``"can0"``; ``"pcan"``, ...
        machine : str
            Which controller is expected; selects the EDS file unless ``eds`` names one.
        serial : str, optional
            Serial number that it must have (0x1018:4).
        limits : mapping, optional
            Actuator -> (lowest, highest) q that the machine file allows; the controller's own
            limits must not be wider.
        silence_s : float
            Wall time without a heartbeat after which a node, or this PC, counts as lost.

        Raises
        ------
        ConnectFailed
            No adapter, no controller on the bus, or a node without heartbeat.
        Refused
            Another device, serial number or wider limits than expected.
        """
        path = eds or eds_path(f"{machine}_controller")
        layout = read_layout(path, node_id)
        address = BusAddress(
            interface, channel, bitrate, heartbeat_s=heartbeat_s, silence_s=silence_s
        )
        link = await CanLink.open(address)
        try:
            controller = cls(link, layout, node_id, path)
            await controller._recognise(serial, limits or {})
            await controller._watch_nodes()
        except BaseException:
            await link.close()
            raise
        return controller

    async def _recognise(
        self, serial: str | None, limits: Mapping[str, tuple[float, float]]
    ) -> None:
        try:
            self.identity = await self._call(lambda: read_identity(self._controller, self.layout))
        except Silence as error:
            raise ConnectFailed(
                f"the adapter answers, {self._device} does not",
                device=self._link.name,
                remedy="Check that the controller is switched on, its node number and bit rate.",
            ) from error
        check_serial(self.identity, serial, self._device)
        await self._call(lambda: check_limits(self._controller, self.layout, limits))

    async def _watch_nodes(self) -> None:
        """Configure both heartbeats, set all nodes OPERATIONAL and hear each of them once."""
        address = self._link.address
        producer = struct.pack("<H", round(address.heartbeat_s * 1000))
        consumer = struct.pack("<I", address.pc_node << 16 | round(address.silence_s * 1000))

        def configure(device: Device) -> None:
            device.download(0x1017, 0, producer)
            device.download(0x1016, 1, consumer)

        begin = time.monotonic()
        try:
            for device in self._devices:
                await device.call(partial(configure, device))
        except Silence as error:
            raise ConnectFailed(error.what, device=error.device, remedy=error.remedy) from error
        await self._link.operational()
        while missing := [d for d in self._devices if not self._link.heard_since(d.id, begin)]:
            if time.monotonic() - begin > address.silence_s + ANSWER_DEADLINE_S:
                names = ", ".join(device.label for device in missing)
                raise ConnectFailed(
                    f"no heartbeat from {names}",
                    device=self._link.name,
                    remedy="Check that all devices are switched on.",
                )
            await asyncio.sleep(0.01)
        await self._motion.synchronise()
        for drive in self._drives:
            if state_name(await drive.read(STATUSWORD)) == "fault":
                self._latch_drive(drive.remote.id, await drive.read(0x603F))

    async def _call(self, action: Callable[[], T]) -> T:
        return await self._controller.call(action)

    # ------------------------------------------------------------ what comes unasked

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """Call ``callback`` in the event loop for everything said unasked."""
        self._callbacks.append(callback)

    def check(self) -> None:
        """Raise the fault that is standing (link lost, heartbeat lost, drive fault), if any."""
        self._link.check()

    def _alarm(self, alarm: Alarm) -> None:
        for callback in self._callbacks:
            callback(alarm)

    def _on_fault(self, fault: DeviceError) -> None:
        self._alarm(Alarm(fault.device, fault.what, fault.remedy, fault=True))
        self._motion.wake()

    def _on_emergency(self, node_id: int, code: int, _register: int) -> None:
        if code == 0:
            self._alarm(Alarm(self._link.label(node_id), "the error is gone"))
        else:
            self._latch_drive(node_id, code)

    def _latch_drive(self, node_id: int, code: int) -> None:
        self._link.latch(f"drive {node_id}", drive_fault(self._link.label(node_id), code))

    # ------------------------------------------------------------ state

    async def state(self) -> ControllerState:
        """Read a snapshot."""
        words = await asyncio.gather(*(drive.read(STATUSWORD) for drive in self._drives))
        positions = await self._motion.read_array(at.ACTUAL_Q)
        targets = await self._motion.read_array(at.TARGET_Q)
        status = await self._motion.refresh()
        actuators = tuple(
            ActuatorState(
                name=drive.name,
                position=position,
                target=target,
                state=state_name(word),
                moving=status.moving,
                homed=bool(word & REFERENCED),
                fault=self._fault_of(drive),
            )
            for drive, word, position, target in zip(
                self._drives, words, positions, targets, strict=True
            )
        )
        return ControllerState(actuators, status.moving, status.enabled, await self.channels())

    def _fault_of(self, drive: Drive402) -> str:
        fault = self._link.faults.get(f"drive {drive.remote.id}")
        return fault.what if fault is not None else ""

    async def channels(self) -> dict[str, float]:
        """Read the controller's channels: ``structure_temp_C``, ``payload_kg``."""
        addresses = self.layout.channels

        def read() -> dict[str, float]:
            data = {name: self._controller.upload(*place) for name, place in addresses.items()}
            return {name: struct.unpack("<d", raw)[0] for name, raw in data.items()}

        return await self._call(read)

    # ------------------------------------------------------------ power

    async def enable(self) -> None:
        """Bring all drives to operation enabled; raises DriveFault, Silence, Refused."""
        self.check()
        await asyncio.gather(*(drive.enable() for drive in self._drives))
        self._stopped = False
        if not await self._motion.until(lambda status: status.enabled, ANSWER_DEADLINE_S):
            raise Silence(
                "the controller does not see its drives enabled",
                device=self._device,
                remedy="Look at the drives' states on the devices screen.",
            )

    async def disable(self) -> None:
        """Take the power off all drives."""
        await asyncio.gather(*(drive.disable() for drive in self._drives))
        await self._motion.refresh()

    async def clear_faults(self) -> None:
        """Reset standing faults; motion stays disabled until :meth:`enable`.

        Raises DriveFault if a drive stays in fault, HeartbeatLost if a node stays silent, and
        LinkLost if the link is gone.
        """
        self._link.clear_faults()
        self.check()
        # A node that was switched off meanwhile has forgotten whom it watches.
        await self._watch_nodes()
        for drive in self._drives:
            await drive.clear_fault()
            self._link.unlatch(f"drive {drive.remote.id}")
        self.check()

    # ------------------------------------------------------------ motion

    async def home(self, actuator: str) -> None:
        """Run one actuator's homing; raises Refused, DriveFault, Silence."""
        self.check()
        await self._drive(actuator).home(SINGLE_MOTION_DEADLINE_S)

    async def jog(self, actuator: str, q: float) -> None:
        """Move one actuator alone to ``q`` and wait until it is there.

        The controller turns q into the drive's set-point (its parameters, its compensation); the
        drive moves in profile position mode. Raises Refused, DriveFault, Silence.
        """
        self.check()
        drive = self._drive(actuator)
        sub = self.layout.actuators.index(actuator) + 1
        await self._call(
            lambda: self._controller.download(at.COMMANDED_Q, sub, struct.pack("<d", q))
        )
        await self._motion.command(PREPARE + sub)
        data = await self._call(lambda: self._controller.upload(at.SETPOINTS, sub))
        await drive.move_to(int.from_bytes(data, "little", signed=True), SINGLE_MOTION_DEADLINE_S)

    def _drive(self, actuator: str) -> Drive402:
        for drive in self._drives:
            if drive.name == actuator:
                return drive
        raise Refused(
            f"there is no actuator {actuator!r}",
            device=self._device,
            remedy=f"Name one of {', '.join(self.layout.actuators)}.",
        )

    async def move_to_pose(self, pose: tuple[float, ...]) -> tuple[float, ...]:
        """Command a pose and start moving; returns the controller's targets q.

        For the hexapod x, y, z in mm and alpha, beta, gamma in rad, R = Rz(gamma) Ry(beta)
        Rx(alpha). Raises Refused (limits, unreachable, not enabled) or the standing fault.
        """
        self.check()
        self._check_numbers(pose, len(self.layout.pose), "pose")
        await self._motion.command(MOVE_TO_POSE, pose)
        return await self._motion.targets()

    async def move_to_q(self, q: tuple[float, ...]) -> None:
        """Command all actuators together and start moving; raises Refused."""
        self.check()
        self._check_numbers(q, len(self.layout.actuators), "q")

        def write() -> None:
            for sub, value in enumerate(q, start=1):
                self._controller.download(at.COMMANDED_Q, sub, struct.pack("<d", value))

        await self._call(write)
        await self._motion.command(MOVE_TO_Q)

    def _check_numbers(self, values: tuple[float, ...], count: int, what: str) -> None:
        if len(values) != count or not all(map(math.isfinite, values)):
            raise Refused(
                f"{what} needs {count} finite numbers, got {values}",
                device=self._device,
                remedy="Nothing was commanded.",
            )

    async def wait_arrived(self, timeout: float) -> None:
        """Wait until every drive reports its target reached; ``timeout`` in wall seconds.

        Raises DriveFault or HeartbeatLost (that fault), DeviceFault if the motion was stopped,
        Silence at the deadline, LinkLost.
        """
        await self._motion.wait_arrived(timeout)

    async def stop(self) -> None:
        """Quick stop, at any moment and from any state; never raises for a second call.

        The frames go out at once, past every SDO transfer under way. The drives brake and switch
        off; :meth:`enable` brings them back. Raises LinkLost if the frames cannot be sent, Silence
        if the machine does not come to rest.
        """
        quick = struct.pack("<H", QUICK_STOP)
        frames = [(0x200 + drive.remote.id, quick) for drive in self._drives]
        again, self._stopped = self._stopped, True
        try:
            await self._link.send([self._motion.command_frame(STOP), *frames])
            await self._rest()
        except LinkError as error:
            if not again:
                raise type(error)(
                    f"the stop was not confirmed ({error.what})",
                    device=error.device,
                    remedy="Use the emergency stop. Drives stop by themselves without the PC.",
                ) from error

    async def _rest(self) -> None:
        deadline = time.monotonic() + ANSWER_DEADLINE_S
        while (await self._motion.refresh()).moving:
            if time.monotonic() > deadline:
                raise Silence("the machine is still moving", device=self._device)
            await asyncio.sleep(0.005)

    # ------------------------------------------------------------ parameters

    async def read_parameters(self) -> dict[str, float]:
        """Read every kinematic and compensation parameter; raises ParameterError."""
        return await self._call(self._parameters.read)

    async def write_parameters(self, values: Mapping[str, float]) -> None:
        """Write to volatile memory, read back bit for bit; motion must be disabled.

        Raises Refused (with the name of the parameter) or ParameterError. What was written before
        a failure stays written: the caller restores its snapshot.
        """
        chosen = dict(values)
        await self._call(lambda: self._parameters.write(chosen))

    async def parameter_checksum(self) -> int:
        """CRC-32 that the controller computes over the parameters that it uses now."""
        return await self._call(self._parameters.checksum)

    async def store_parameters(self) -> None:
        """Make the volatile parameters survive a power cycle; raises Refused."""
        await self._call(lambda: self._parameters.command(at.STORE, at.SAVE))

    async def reload_parameters(self) -> None:
        """Bring the stored parameters back into use; motion must be disabled."""
        await self._call(lambda: self._parameters.command(at.RELOAD, at.LOAD))

    async def restore_default_parameters(self) -> None:
        """Forget the stored parameters: the controller's defaults count from its next start."""
        await self._call(lambda: self._parameters.command(at.RESTORE, at.LOAD))

    # ------------------------------------------------------------ the end

    async def close(self) -> None:
        """Take the power off, let the nodes stop watching this PC, release the link."""
        if self._link.closed:
            return
        off = struct.pack("<H", DISABLE_VOLTAGE)
        try:
            if "link" not in self._link.faults:
                frames = [(0x200 + drive.remote.id, off) for drive in self._drives]
                await self._link.send([self._motion.command_frame(STOP), *frames])
                for device in self._devices:
                    await device.call(partial(device.download, 0x1016, 1, bytes(4)))
        except (DeviceError, DeviceFault) as error:
            self._alarm(Alarm(self._device, f"closed without a farewell: {error.what}"))
        await self._link.close()
