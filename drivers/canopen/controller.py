"""A motion controller and its drives on CANopen.

:class:`CanopenController` is a :class:`drivers.interface.MotionController`. What the machine is
follows from the controller's EDS file. Objects, PDOs and numbers: docs/protocols/canopen.md.
"""

import asyncio
import math
import struct
import time
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from drivers.canopen import layout as at
from drivers.canopen.bus_address import BusAddress
from drivers.canopen.drive402 import DISABLE_VOLTAGE, REFERENCED, STATUSWORD, Drive402, state_name
from drivers.canopen.eds import eds_path
from drivers.canopen.layout import read_layout
from drivers.canopen.link import CanLink
from drivers.canopen.machine_bus import MachineBus
from drivers.canopen.motion import MOVE_TO_POSE, MOVE_TO_Q, PREPARE
from drivers.canopen.parameter_access import ParameterAccess
from drivers.errors import Refused, Silence
from drivers.interface import ActuatorState, Alarm, ControllerCan, ControllerState, Identity
from drivers.stopping import STILL_MOVING, confirmed

T = TypeVar("T")
ANSWER_DEADLINE_S = 2.0
SINGLE_MOTION_DEADLINE_S = 60.0


class CanopenController:
    """The controller node with its drives; made by :meth:`connect`.

    Alarms come for every EMCY and every fault that :meth:`check` would raise. Faults stand until
    :meth:`clear_faults`; after a lost link only a new :meth:`connect` helps.
    """

    def __init__(self, bus: MachineBus, identity: Identity) -> None:
        self.identity = identity
        self.can = ControllerCan(channels=tuple(bus.layout.channels))
        self.layout = bus.layout
        self._bus = bus
        self._drives = bus.drives
        self._motion = bus.motion
        self._device = bus.controller.label
        self._parameters = ParameterAccess(bus.controller, bus.layout)
        self._stopped = False

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
        options: Mapping[str, Any] | None = None,
        drive_nodes: Sequence[int] = (),
        drive_eds: Sequence[Path] = (),
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
        options : mapping, optional
            Further keywords of the interface, as python-can calls them.
        drive_nodes : sequence of int, optional
            Nodes of the drives; 1, 2, ... if there are none.
        drive_eds : sequence of path, optional
            EDS file of the drives, one for all or one for each; the shipped one if there is none.

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
            interface, channel, bitrate, heartbeat_s=heartbeat_s, silence_s=silence_s,
            more=options or {},
        )  # fmt: skip
        link = await CanLink.open(address)
        try:
            bus = MachineBus(link, layout, node_id, path, drive_nodes, drive_eds)
            identity = await bus.recognise(serial, limits or {})
            await bus.watch()
            await bus.note_faults()
        except BaseException:
            await link.close()
            raise
        return cls(bus, identity)

    async def _call(self, action: Callable[[], T]) -> T:
        return await self._bus.controller.call(action)

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """Call ``callback`` in the event loop for everything said unasked."""
        self._bus.callbacks.append(callback)

    def check(self) -> None:
        """Raise the fault that is standing (link lost, heartbeat lost, drive fault), if any."""
        self._bus.link.check()

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
        fault = self._bus.link.faults.get(f"drive {drive.remote.id}")
        return fault.what if fault is not None else ""

    async def channels(self) -> dict[str, float]:
        """Read the controller's channels: ``structure_temp_C``, ``payload_kg``."""
        addresses = self.layout.channels

        def read() -> dict[str, float]:
            data = {name: self._bus.controller.upload(*place) for name, place in addresses.items()}
            return {name: struct.unpack("<d", raw)[0] for name, raw in data.items()}

        return await self._call(read)

    # ------------------------------------------------------------ power

    async def enable(self) -> None:
        """Bring all drives to operation enabled; raises DriveFault, Silence, Refused.

        If one of them cannot, the others are switched off again.
        """
        self.check()
        walks = (drive.enable() for drive in self._drives)
        failures = [f for f in await asyncio.gather(*walks, return_exceptions=True) if f]
        if failures:
            await self._bus.send_stop(DISABLE_VOLTAGE)
            raise failures[0]
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

        Raises DriveFault if a drive stays in fault, ConnectFailed if a node stays silent, and
        LinkLost if the link is gone.
        """
        await self._bus.clear()

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
            lambda: self._bus.controller.download(at.COMMANDED_Q, sub, struct.pack("<d", q))
        )
        await self._motion.command(PREPARE + sub)
        data = await self._call(lambda: self._bus.controller.upload(at.SETPOINTS, sub))
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

        In the machine's own coordinates: for the hexapod x, y, z in mm and rx, ry, rz in rad,
        R = Rz(rz) Ry(ry) Rx(rx); for the ptm tilt and azimuth in rad. Raises Refused
        (limits, unreachable, not enabled) or the standing fault.
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
                self._bus.controller.download(at.COMMANDED_Q, sub, struct.pack("<d", value))

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

    def stop_at_once(self) -> None:
        """Quick stop from any thread, without waiting for rest; never raises."""
        self._bus.stop_at_once()

    async def stop(self) -> None:
        """Quick stop, at any moment and from any state; never raises for a second call.

        The frames go out at once, past every SDO transfer under way. The drives brake and switch
        off; :meth:`enable` brings them back. Raises LinkLost if the frames cannot be sent, Silence
        if the machine does not come to rest, HeartbeatLost of a drive that cannot be asked.
        """
        again, self._stopped = self._stopped, True
        async with confirmed(again):
            await self._bus.send_stop()
            await self._rest()

    async def _rest(self) -> None:
        deadline = time.monotonic() + ANSWER_DEADLINE_S
        while (await self._motion.refresh()).moving:
            if time.monotonic() > deadline:
                raise Silence(
                    "the machine is still moving", device=self._device, remedy=STILL_MOVING
                )
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
        await self._bus.leave()
