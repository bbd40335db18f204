"""A driver for motors that take their targets as lines of text on TCP; the README has the lines.

It implements ``drivers.interface.Motors``: values of q in the units of the machine file go out,
positions come back. What moves where is the host's business.
"""

import asyncio
import contextlib
import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from drivers.errors import (
    ConnectFailed,
    DeviceError,
    LinkLost,
    NotReady,
    ProtocolError,
    Refused,
    Silence,
)
from drivers.interface import ActuatorState, Alarm, ControllerCan, ControllerState, Identity, Motors
from drivers.kind import Kind, Setting, Surroundings

LOOK_S = 0.02
REMEDY = "Check the motors' program, its cable and its address, then connect again."


class LineMotors:
    """Motors with absolute encoders: they know where they are, and need no homing."""

    def __init__(
        self,
        reader: asyncio.StreamReader,
        writer: asyncio.StreamWriter,
        names: Sequence[str],
        device: str,
        silence_s: float,
    ) -> None:
        self.identity = Identity("line-motors")
        self.can = ControllerCan(parameters=False, homes=False)
        self._reader, self._writer = reader, writer
        self._names = names
        self._device = device
        self._silence_s = silence_s
        self._turn = asyncio.Lock()
        self._lost: DeviceError | None = None

    @classmethod
    async def connect(cls, around: Surroundings) -> "LineMotors":
        """Connect and ask where the motors are; raises ConnectFailed, Silence."""
        host, port = around.settings["address"].rsplit(":", 1)
        device, patience = f"motors {host}:{port}", around.settings["silence_s"]
        try:
            async with asyncio.timeout(patience):
                reader, writer = await asyncio.open_connection(host, int(port))
        except (OSError, TimeoutError) as error:
            raise ConnectFailed(f"{error or 'no answer'}", device=device, remedy=REMEDY) from None
        motors = cls(reader, writer, [a.name for a in around.actuators], device, patience)
        try:
            await motors.state()
        except BaseException:
            await motors.close()
            raise
        return motors

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """It says nothing unasked."""

    def check(self) -> None:
        """Raise what ended the link, if anything did."""
        if self._lost is not None:
            raise self._lost

    async def move_actuators(self, q: tuple[float, ...]) -> None:
        """Send all targets in one line: the program starts them together or none."""
        if not all(math.isfinite(value) for value in q):
            raise Refused("a target is no number", device=self._device)
        await self._told("GO " + " ".join(repr(float(value)) for value in q))

    async def wait_arrived(self, timeout: float) -> None:
        """Ask until nothing moves; a stop short of the target is no arrival."""
        try:
            async with asyncio.timeout(timeout):
                while (await self.state()).moving:  # noqa: ASYNC110 - nothing is told unasked
                    await asyncio.sleep(LOOK_S)
        except TimeoutError:
            raise NotReady("still moving", device=self._device, remedy="Stop it") from None

    async def state(self) -> ControllerState:
        """Where every motor is, and where it is bound for."""
        words, count = (await self._told("AT?")).split(), len(self._names)
        try:
            on, moving, *numbers = (float(word) for word in words)
        except ValueError:
            numbers = []
        if len(numbers) != 2 * count:
            raise ProtocolError(f"answers {' '.join(words)}", device=self._device)
        actuators = tuple(
            ActuatorState(
                name, numbers[k], numbers[count + k], "on" if on else "off", bool(moving), True
            )
            for k, name in enumerate(self._names)
        )
        return ControllerState(actuators, bool(moving), bool(on))

    async def enable(self) -> None:
        """Power on."""
        await self._told("ON")

    async def disable(self) -> None:
        """Power off."""
        await self._told("OFF")

    async def clear_faults(self) -> None:
        """It has none that stand."""
        self.check()

    async def home(self, actuator: str) -> None:
        """Refused: its encoders are absolute."""
        raise Refused(f"{actuator} needs no reference move", device=self._device)

    async def stop(self) -> None:
        """Brake; what cannot be said any more is left to :meth:`check`."""
        with contextlib.suppress(DeviceError):
            await self._told("HALT")

    async def channels(self) -> dict[str, float]:
        """It measures nothing beside."""
        return {}

    async def close(self) -> None:
        """End the connection."""
        self._lost = self._lost or LinkLost("closed", device=self._device)
        self._writer.close()
        with contextlib.suppress(OSError):
            await self._writer.wait_closed()

    async def _told(self, line: str) -> str:
        """The answer to a line, before a deadline."""
        self.check()
        async with self._turn:
            try:
                async with asyncio.timeout(self._silence_s):
                    self._writer.write(f"{line}\n".encode())
                    answer = (await self._reader.readline()).decode("ascii", "replace").strip()
            except TimeoutError:
                self._lost = Silence(f"no answer to {line}", device=self._device, remedy=REMEDY)
            except OSError as error:
                self._lost = LinkLost(str(error), device=self._device, remedy=REMEDY)
            else:
                if not answer:
                    self._lost = LinkLost("it hung up", device=self._device, remedy=REMEDY)
        self.check()
        if answer.startswith("NO"):
            raise Refused(answer[2:].strip() or "no", device=self._device)
        return answer


def _address(settings: Mapping[str, Any]) -> str:
    return str(settings["address"])


KIND: Kind[Motors] = Kind(
    says="Motors that take their targets as lines of text on TCP",
    settings=(
        Setting("address", "address", "host:port of their program"),
        Setting(
            "silence_s", "number", "seconds without an answer that are a fault", 2.0, least=0.1
        ),
    ),
    open=LineMotors.connect,
    address=_address,
    takes="actuators",
)
