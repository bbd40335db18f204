"""Motors on a TCP line, and their driver: what the host moves in these tests.

Lines: ``ON``, ``OFF``, ``GO q1 q2 ...``, ``HALT``, ``AT?`` -> state; every line is answered.
"""

import asyncio
import contextlib
from collections.abc import Callable, Mapping, Sequence
from time import monotonic
from typing import Any, Protocol

from drivers.errors import DeviceError, LinkLost, Refused, Silence
from drivers.interface import ActuatorState, Alarm, ControllerCan, ControllerState, Identity
from drivers.kind import Kind, Setting, Surroundings
from mocks.physics.motion import LegMotion

SPEED = 200.0
MACHINE_SPEED = 5.0
ANSWER_S = 2.0


class Axes(Protocol):
    """What stands behind the line; q in the order and units of the machine file."""

    def at(self) -> list[float]: ...

    def goal(self) -> list[float]: ...

    def moving(self) -> bool: ...

    def go(self, goal: list[float]) -> None: ...

    def halt(self) -> None: ...


class BareAxes:
    """Motors that move straight to where they are sent, and move nothing else."""

    def __init__(self, home: Sequence[float]) -> None:
        self._start = self._goal = [float(q) for q in home]
        self._began = self._lasts = 0.0

    def at(self) -> list[float]:
        share = min((monotonic() - self._began) / self._lasts, 1.0) if self._lasts else 1.0
        return [a + share * (b - a) for a, b in zip(self._start, self._goal, strict=True)]

    def goal(self) -> list[float]:
        return self._goal

    def moving(self) -> bool:
        return self.at() != self._goal

    def go(self, goal: list[float]) -> None:
        self._start, self._goal, self._began = self.at(), goal, monotonic()
        far = max(abs(a - b) for a, b in zip(self._start, goal, strict=True))
        self._lasts = far / SPEED

    def halt(self) -> None:
        self._start = self._goal = self.at()
        self._lasts = 0.0


class LegsOfWorld:
    """The legs of a mock machine: extension = q - reference of the drawing."""

    def __init__(self, legs: Sequence[LegMotion], reference: Sequence[float]) -> None:
        self._legs, self._reference = legs, reference

    def at(self) -> list[float]:
        return [r + leg.position() for r, leg in zip(self._reference, self._legs, strict=True)]

    def goal(self) -> list[float]:
        return [r + leg.target for r, leg in zip(self._reference, self._legs, strict=True)]

    def moving(self) -> bool:
        return any(leg.moving for leg in self._legs)

    def go(self, goal: list[float]) -> None:
        far = max(abs(a - b) for a, b in zip(self.at(), goal, strict=True))
        for leg, q, reference in zip(self._legs, goal, self._reference, strict=True):
            leg.command(q - reference, max(far / MACHINE_SPEED, 0.01))

    def halt(self) -> None:
        for leg in self._legs:
            leg.stop()


class LineServer:
    """The device."""

    def __init__(self, axes: Axes, limits: Sequence[tuple[float, float]]) -> None:
        self.axes = axes
        self.limits = limits
        self.on = self.silent = False
        self.sent: list[tuple[float, ...]] = []

    async def open(self) -> None:
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", 0)
        self.port: int = self._server.sockets[0].getsockname()[1]

    async def close(self) -> None:
        self._server.close()
        await self._server.wait_closed()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        with contextlib.suppress(OSError, asyncio.CancelledError):
            while line := (await reader.readline()).decode():
                if not self.silent:
                    writer.write(f"{self._answer(line.split())}\n".encode())
        writer.close()

    def _answer(self, words: list[str]) -> str:
        match words:
            case ["ON" | "OFF" as word]:
                self.on = word == "ON"
            case ["GO", *numbers]:
                return self._go([float(number) for number in numbers])
            case ["HALT"]:
                self.axes.halt()
            case ["AT?"]:
                numbers = " ".join(map(repr, [*self.axes.at(), *self.axes.goal()]))
                return f"{int(self.on)} {int(self.axes.moving())} {numbers}"
            case _:
                return "NO what?"
        return "OK"

    def _go(self, goal: list[float]) -> str:
        if not self.on:
            return "NO power"
        if any(not low <= q <= high for q, (low, high) in zip(goal, self.limits, strict=True)):
            return "NO limit"
        self.axes.go(goal)
        self.sent.append(tuple(goal))
        return "OK"


class LineMotors:
    """The driver: :class:`drivers.interface.Motors`."""

    can = ControllerCan(parameters=False, homes=False, channels=())

    def __init__(
        self, names: Sequence[str], reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        self.identity = Identity("line-motors", serial="7")
        self._names = names
        self._reader, self._writer = reader, writer
        self._turn = asyncio.Lock()

    @classmethod
    async def connect(cls, port: int, names: Sequence[str]) -> "LineMotors":
        return cls(names, *await asyncio.open_connection("127.0.0.1", port))

    async def _say(self, line: str) -> str:
        async with self._turn:
            try:
                async with asyncio.timeout(ANSWER_S):
                    self._writer.write(f"{line}\n".encode())
                    answer = (await self._reader.readline()).decode().strip()
            except TimeoutError:
                raise Silence(f"no answer to {line}", device="motors") from None
            except (OSError, RuntimeError) as error:
                raise LinkLost(f"{error or 'closed'}", device="motors") from None
        if not answer:
            raise LinkLost("the line is closed", device="motors")
        if answer.startswith("NO"):
            raise Refused(answer[3:], device="motors")
        return answer

    async def move_actuators(self, q: tuple[float, ...]) -> None:
        await self._say("GO " + " ".join(map(repr, q)))

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None: ...

    def check(self) -> None:
        if self._writer.is_closing():
            raise LinkLost("the line is closed", device="motors")

    async def _numbers(self) -> list[float]:
        return [float(word) for word in (await self._say("AT?")).split()]

    async def state(self) -> ControllerState:
        on, moving, *rest = await self._numbers()
        count = len(self._names)
        return ControllerState(
            tuple(
                ActuatorState(name, rest[k], rest[count + k], "on", bool(moving), homed=True)
                for k, name in enumerate(self._names)
            ),
            bool(moving),
            bool(on),
        )

    async def enable(self) -> None:
        await self._say("ON")

    async def disable(self) -> None:
        await self._say("OFF")

    async def clear_faults(self) -> None:
        await self._say("HALT")

    async def home(self, actuator: str) -> None:
        raise Refused(f"{actuator} has an absolute encoder", device="motors")

    async def wait_arrived(self, timeout: float) -> None:
        try:
            async with asyncio.timeout(timeout):
                while (await self.state()).moving:  # noqa: ASYNC110 - the line tells nothing unasked
                    await asyncio.sleep(0.01)
        except TimeoutError:
            raise Silence("still moving", device="motors") from None

    async def stop(self) -> None:
        with contextlib.suppress(DeviceError):
            await self._say("HALT")

    async def channels(self) -> dict[str, float]:
        return {}

    async def close(self) -> None:
        self._writer.close()
        with contextlib.suppress(OSError):
            await self._writer.wait_closed()


def _address(settings: Mapping[str, Any]) -> str:
    return f"line {settings['port']}"


async def _open(around: Surroundings) -> LineMotors:
    return await LineMotors.connect(around.settings["port"], [a.name for a in around.actuators])


KIND: Kind[LineMotors] = Kind(
    says="Motors on a line of text",
    settings=(Setting("port", "whole", "its TCP port"),),
    open=_open,
    address=_address,
    takes="actuators",
)
