"""One CiA 402 drive: power state machine, homing, profile position, fault reset.

Everything is read back and every wait has a deadline in wall seconds. ``canopen.BaseNode402`` is
not used: its mode setter swallows errors, its homing returns False instead of raising, and it
knows no set-point handshake.
"""

import asyncio
import struct
import time
from collections.abc import Callable

from canopen.objectdictionary import ODVariable

from drivers.canopen.control_frame import Address, ReceivePdo, control_pdo
from drivers.canopen.device import Device
from drivers.errors import DriveFault, ProtocolError, Refused, Silence

CONTROLWORD, STATUSWORD, MODE, MODE_DISPLAY = 0x6040, 0x6041, 0x6060, 0x6061
TARGET_POSITION, ERROR_CODE = 0x607A, 0x603F
ACTUAL_POSITION, POSITION_WINDOW, HOME_OFFSET = 0x6064, 0x6067, 0x607C
PROFILE_POSITION, HOMING, CYCLIC_POSITION = 1, 6, 8
SHUTDOWN, SWITCH_ON, ENABLE, QUICK_STOP, DISABLE_VOLTAGE = 0x06, 0x07, 0x0F, 0x02, 0x00
FAULT_RESET, NEW_SETPOINT, AT_ONCE = 0x80, 0x10, 0x20
REACHED, LIMITED, ACKNOWLEDGED, FAILED = 1 << 10, 1 << 11, 1 << 12, 1 << 13
REFERENCED = 1 << 15
STATE_DEADLINE_S = 2.0
BEGIN_DEADLINE_S = 0.5
"""Wall time in which a drive that begins a motion takes back the bits of an earlier one."""
POLL_S = 0.002

STATES = (
    (0x4F, 0x00, "not ready to switch on"),
    (0x4F, 0x40, "switch on disabled"),
    (0x6F, 0x21, "ready to switch on"),
    (0x6F, 0x23, "switched on"),
    (0x6F, 0x27, "operation enabled"),
    (0x6F, 0x07, "quick stop active"),
    (0x4F, 0x0F, "fault reaction active"),
    (0x4F, 0x08, "fault"),
)
# What brings a drive one step nearer to operation enabled.
NEXT_COMMAND = {
    "switch on disabled": SHUTDOWN,
    "ready to switch on": SWITCH_ON,
    "switched on": ENABLE,
    "quick stop active": DISABLE_VOLTAGE,
}
ERROR_WORDS = {
    0x5000: "hardware error",
    0x5530: "non-volatile memory damaged",
    0x8130: "it no longer hears the PC",
    0x8700: "SYNC does not come when it should",
    0x8611: "following error: the leg does not follow its set-point",
}


def state_name(statusword: int) -> str:
    """Return the name of the CiA 402 state in a statusword."""
    for mask, bits, name in STATES:
        if statusword & mask == bits:
            return name
    return f"unknown (statusword 0x{statusword:04X})"


def error_words(code: int) -> str:
    """Return an error code of 0x603F or EMCY in words."""
    return f"{ERROR_WORDS.get(code, 'error')} (0x{code:04X})"


def drive_fault(device: str, code: int) -> DriveFault:
    """Return the exception for a drive that reports error ``code``."""
    return DriveFault(
        error_words(code),
        device=device,
        remedy="Remove the cause, clear the faults and enable the machine again.",
    )


class Drive402:
    """The drive of one actuator.

    Parameters
    ----------
    device : Device
    name : str
        The actuator: ``q1``.
    """

    def __init__(self, device: Device, name: str) -> None:
        self.remote = device
        self.name = name
        self.device = device.label
        self._told: dict[Address, bytes] = {}
        self._control_pdo: ReceivePdo | None = None
        self.stopped = False
        """A stop has overtaken what was under way: only :meth:`enable` gives power again."""

    async def read_control_pdo(self) -> None:
        """Learn from the drive by which PDO it takes its controlword."""
        self._control_pdo = await self.remote.call(lambda: control_pdo(self.remote, self._told))

    def control_frame(self, word: int) -> tuple[int, bytes] | None:
        """The whole frame (COB-ID, data) of a controlword; None if only SDO reaches it."""
        if self._control_pdo is None:
            return None
        return self._control_pdo.frame({**self._told, (CONTROLWORD, 0): struct.pack("<H", word)})

    async def read(self, index: int, sub: int = 0) -> int:
        """Read an integer object."""
        return await self.remote.call(lambda: self.read_now(index, sub))

    async def write(self, index: int, value: int, sub: int = 0) -> None:
        """Write an integer object."""
        await self.remote.call(lambda: self._write(index, value, sub))

    def read_now(self, index: int, sub: int = 0) -> int:
        """Read an integer object; blocking, within :meth:`Device.call`."""
        return int(self._variable(index, sub).decode_raw(self.remote.upload(index, sub)))

    def tell(self, index: int, value: int, sub: int = 0) -> None:
        """Keep a value that was sent by PDO, for the frames that repeat it."""
        self._told[index, sub] = self._variable(index, sub).encode_raw(value)

    def has(self, index: int, sub: int = 0) -> bool:
        """Whether the EDS file has an object."""
        return self.remote.node.object_dictionary.get_variable(index, sub) is not None

    def _write(self, index: int, value: int, sub: int = 0) -> None:
        if index == CONTROLWORD and value & ENABLE == ENABLE and self.stopped:
            raise self._was_stopped("a stop came between")
        data = self._variable(index, sub).encode_raw(value)
        self.remote.download(index, sub, data)
        self._told[index, sub] = data

    def _variable(self, index: int, sub: int) -> ODVariable:
        variable = self.remote.node.object_dictionary.get_variable(index, sub)
        if variable is None:
            raise ProtocolError(
                f"its EDS file has no object 0x{index:04X}:{sub}",
                device=self.device,
                remedy="Use the EDS file of this drive.",
            )
        return variable

    # ------------------------------------------------------------ power

    async def enable(self, mode: int = CYCLIC_POSITION) -> None:
        """Set the mode and walk to operation enabled; raises DriveFault, Silence.

        Refused if a stop comes between.
        """
        self.stopped = False
        await self.set_mode(mode)
        deadline = time.monotonic() + STATE_DEADLINE_S
        while True:
            status = await self.read(STATUSWORD)
            state = state_name(status)
            if state == "operation enabled":
                return
            if state.startswith("fault"):
                raise drive_fault(self.device, await self.read(ERROR_CODE))
            if time.monotonic() > deadline:
                raise Silence(
                    f"remains in state {state!r}, wanted 'operation enabled'",
                    device=self.device,
                    remedy="Check the drive's enable input and its supply.",
                )
            if state in NEXT_COMMAND:
                await self.write(CONTROLWORD, NEXT_COMMAND[state])
            else:
                await asyncio.sleep(POLL_S)

    async def disable(self) -> None:
        """Take the power off; a drive in fault has none already."""
        await self.write(CONTROLWORD, DISABLE_VOLTAGE)
        await self.wait(
            lambda word: state_name(word) in ("switch on disabled", "fault"),
            STATE_DEADLINE_S,
            "take the power off",
            faults=False,
        )

    async def clear_fault(self) -> None:
        """Reset a fault (rising edge of bit 7); raises DriveFault if it stays.

        Drives take their time to do so; the bit stays up until they have.
        """
        if state_name(await self.read(STATUSWORD)) != "fault":
            return
        await self.write(CONTROLWORD, DISABLE_VOLTAGE)
        await self.write(CONTROLWORD, FAULT_RESET)
        deadline = time.monotonic() + BEGIN_DEADLINE_S
        while state_name(await self.read(STATUSWORD)) == "fault":
            if time.monotonic() > deadline:
                await self.write(CONTROLWORD, DISABLE_VOLTAGE)
                raise drive_fault(self.device, await self.read(ERROR_CODE))
            await asyncio.sleep(POLL_S)
        await self.write(CONTROLWORD, DISABLE_VOLTAGE)

    async def set_mode(self, mode: int) -> None:
        """Set the mode of operation and see it in 0x6061, which follows in the drive's own time."""
        await self.write(MODE, mode)
        deadline = time.monotonic() + BEGIN_DEADLINE_S
        while await self.read(MODE_DISPLAY) != mode:
            if time.monotonic() > deadline:
                raise Refused(
                    f"does not take mode of operation {mode}",
                    device=self.device,
                    remedy="Check the supported modes (0x6502) of this drive.",
                )
            await asyncio.sleep(POLL_S)

    async def wait(
        self, arrived: Callable[[int], bool], timeout: float, what: str, faults: bool = True
    ) -> int:
        """Poll the statusword until ``arrived``; raises DriveFault or Silence."""
        deadline = time.monotonic() + timeout
        while True:
            status = await self.read(STATUSWORD)
            if faults and state_name(status).startswith("fault"):
                raise drive_fault(self.device, await self.read(ERROR_CODE))
            if arrived(status):
                return status
            if time.monotonic() > deadline:
                raise Silence(
                    f"did not {what} within {timeout} s (state {state_name(status)!r})",
                    device=self.device,
                    remedy="Stop the machine and look at the actuator.",
                )
            await asyncio.sleep(POLL_S)

    async def _need_enabled(self) -> None:
        state = state_name(await self.read(STATUSWORD))
        if state != "operation enabled":
            raise Refused(
                f"is in state {state!r}", device=self.device, remedy="Enable the machine first."
            )

    def _still_enabled(self, status: int) -> None:
        state = state_name(status)
        if state != "operation enabled":
            raise self._was_stopped(f"state {state!r}")

    def _was_stopped(self, how: str) -> Refused:
        return Refused(
            f"the motion was stopped ({how})",
            device=self.device,
            remedy="Enable the machine and start again.",
        )

    # ------------------------------------------------------------ single motion

    async def home(self, timeout: float, back_to: int | None = CYCLIC_POSITION) -> None:
        """Run the homing procedure of 0x6098, wait for its end, and go to mode ``back_to``, if any.

        Raises DriveFault, Refused (stopped meanwhile), Silence.
        """
        await self._need_enabled()
        await self.set_mode(HOMING)
        await self.write(CONTROLWORD, ENABLE)
        await self.write(CONTROLWORD, ENABLE | NEW_SETPOINT)
        await self._homing_begun()

        def attained(status: int) -> bool:
            self._still_enabled(status)
            if status & FAILED:
                raise DriveFault(
                    "homing failed", device=self.device, remedy="Look at its reference mark."
                )
            return bool(status & ACKNOWLEDGED and status & REACHED)

        await self.wait(attained, timeout, "find its reference")
        await self.write(CONTROLWORD, ENABLE)
        if back_to is not None:
            await self.set_mode(back_to)

    async def _homing_begun(self) -> None:
        """Wait until bits 10 and 12 are those of this homing, not of an earlier one.

        A drive that begins takes them back. One that had nothing to do may have them up again
        before anybody could look: then it stands at its reference.
        """
        deadline = time.monotonic() + BEGIN_DEADLINE_S
        while time.monotonic() < deadline:
            status = await self.read(STATUSWORD)
            self._still_enabled(status)
            if not (status & ACKNOWLEDGED and status & REACHED):
                return
            await asyncio.sleep(POLL_S)
        home = await self.read(HOME_OFFSET) if self.has(HOME_OFFSET) else 0
        window = await self.read(POSITION_WINDOW) if self.has(POSITION_WINDOW) else 0
        if abs(await self.read(ACTUAL_POSITION) - home) > window:
            raise DriveFault(
                "did not begin to look for its reference: it reports that of an earlier homing",
                device=self.device,
                remedy="Look at homing method (0x6098) and reference mark.",
            )

    async def acknowledge(self, taken: bool) -> None:
        """Wait until the drive has taken its set-point, or is ready for the next."""

        def so(status: int) -> bool:
            self._still_enabled(status)
            return bool(status & ACKNOWLEDGED) == taken

        what = "acknowledge its set-point" if taken else "end the set-point handshake"
        await self.wait(so, STATE_DEADLINE_S, what)

    async def move_to(self, counts: int, timeout: float) -> None:
        """Move alone to ``counts`` (profile position, set-point handshake) and wait."""
        await self._need_enabled()
        await self.set_mode(PROFILE_POSITION)
        await self.write(TARGET_POSITION, counts)
        await self.write(CONTROLWORD, ENABLE | NEW_SETPOINT | AT_ONCE)
        await self.acknowledge(True)
        await self.write(CONTROLWORD, ENABLE)
        await self.acknowledge(False)

        def reached(status: int) -> bool:
            self._still_enabled(status)
            return bool(status & REACHED)

        status = await self.wait(reached, timeout, "reach its target")
        await self.set_mode(CYCLIC_POSITION)
        if status & LIMITED:
            raise Refused(
                "the target is outside the drive's software limits (0x607D)",
                device=self.device,
                remedy="The actuator stands at its limit; command a position inside.",
            )
