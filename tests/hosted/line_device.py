"""Motors on a TCP line: the device behind the driver in ``examples/line_motors``."""

import asyncio
import contextlib
from collections.abc import Sequence
from time import monotonic
from typing import Protocol

from mocks.physics.motion import LegMotion

SPEED = 200.0
MACHINE_SPEED = 5.0


class Axes(Protocol):
    """What stands behind the line; q in the order and units of the machine file."""

    def at(self) -> list[float]: ...

    def goal(self) -> list[float]: ...

    def moving(self) -> bool: ...

    def go(self, goal: list[float]) -> None: ...

    def halt(self) -> None: ...


class BareAxes:
    """Motors that move straight to where they are sent, and move nothing else."""

    def __init__(self, home: Sequence[float], *, forgets_halt: bool = False) -> None:
        self._start = self._goal = self._shown = [float(q) for q in home]
        self._forgets_halt = forgets_halt
        self._began = self._lasts = 0.0

    def at(self) -> list[float]:
        share = min((monotonic() - self._began) / self._lasts, 1.0) if self._lasts else 1.0
        return [a + share * (b - a) for a, b in zip(self._start, self._goal, strict=True)]

    def goal(self) -> list[float]:
        return self._shown

    def moving(self) -> bool:
        return self.at() != self._goal

    def go(self, goal: list[float]) -> None:
        self._start, self._goal, self._began = self.at(), goal, monotonic()
        self._shown = goal
        far = max(abs(a - b) for a, b in zip(self._start, goal, strict=True))
        self._lasts = far / SPEED

    def halt(self) -> None:
        self._start = self._goal = self.at()
        self._lasts = 0.0
        if not self._forgets_halt:
            self._shown = self._goal


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
        if len(goal) != len(self.limits):
            return "NO count"
        if any(not low <= q <= high for q, (low, high) in zip(goal, self.limits, strict=True)):
            return "NO limit"
        self.axes.go(goal)
        self.sent.append(tuple(goal))
        return "OK"
