"""Laws of everything that moves, whatever it takes as a command."""

import asyncio
import math
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any, Protocol

from drivers.contract.bench import Act, Law, hold, refuses
from drivers.errors import DeviceError, Refused
from drivers.interface import ControllerCan, Moving

NEAR = {"mm": 0.05, "rad": 1e-3}
"""How near to its target an axis stands that has arrived."""


class MovingBench(Protocol):
    """What the laws ask of the bench of anything that moves."""

    @property
    def longest_s(self) -> float:
        """Wall seconds in which every call must have ended, a move too."""

    @property
    def settle_s(self) -> float:
        """Wall seconds after which a machine that was stopped stands."""

    @property
    def silence(self) -> Act | None:
        """Let the device answer nothing more."""

    @property
    def axes(self) -> tuple[tuple[str, str], ...]:
        """Names and units of the actuators of its state."""

    async def connect(self) -> Any:
        """A new driver."""

    async def start(self, device: Any, which: int) -> None:
        """Start the move to the first or the second place (0, 1)."""

    async def start_out_of_reach(self, device: Any) -> None:
        """Ask for what cannot be reached."""

    async def start_nan(self, device: Any) -> None:
        """Ask for what is no number."""


@asynccontextmanager
async def connected(bench: MovingBench, *, enabled: bool) -> AsyncIterator[Any]:
    """A driver, connected; if ``enabled`` with its drives on and referenced."""
    async with asyncio.timeout(bench.longest_s):
        device = await bench.connect()
    try:
        if enabled:
            await device.enable()
            while lost := [a for a in (await device.state()).actuators if not a.homed]:
                if not device.can.homes:
                    break
                await device.home(lost[0].name)
        yield device
    finally:
        async with asyncio.timeout(bench.longest_s):
            await device.close()


async def moved(device: Moving, bench: MovingBench, which: int) -> None:
    """Go to the first or the second place and wait until it is there."""
    await bench.start(device, which)
    await device.wait_arrived(bench.longest_s)


async def _says_who_it_is(bench: MovingBench) -> None:
    async with connected(bench, enabled=False) as device:
        hold(bool(device.identity.kind), "its identity has no kind")
        hold(isinstance(device.can, ControllerCan), "it does not say what it can")
        device.check()
        state = await device.state()
        names = tuple(actuator.name for actuator in state.actuators)
        wanted = tuple(name for name, _ in bench.axes)
        hold(names == wanted, f"its actuators are {names}, the machine's {wanted}")
        hold(all(math.isfinite(a.position) for a in state.actuators), "a position is no number")
        hold(not state.enabled and not state.moving, "it is on, or moves, before anybody asked")


async def _switches(bench: MovingBench) -> None:
    async with connected(bench, enabled=True) as device:
        hold((await device.state()).enabled, "after enable() it says that it is off")
        await device.disable()
        hold(not (await device.state()).enabled, "after disable() it says that it is on")
        error = await refuses(moved(device, bench, 1), bench.longest_s, "a move while off")
        hold(isinstance(error, Refused), f"a move while off ends in {error!r}")


async def _refuses_what_it_cannot_reach(bench: MovingBench) -> None:
    async with connected(bench, enabled=True) as device:
        error = await refuses(
            bench.start_out_of_reach(device), bench.longest_s, "what is out of reach"
        )
        hold(isinstance(error, Refused), f"what is out of reach ends in {error!r}")
        await refuses(bench.start_nan(device), bench.longest_s, "a place of nan")
        hold(not (await device.state()).moving, "it refuses, and moves")
        await moved(device, bench, 0)


async def _stops(bench: MovingBench) -> None:
    async with connected(bench, enabled=True) as device:
        await moved(device, bench, 0)
        await bench.start(device, 1)
        waiting = asyncio.ensure_future(device.wait_arrived(bench.longest_s))
        await asyncio.sleep(0)
        async with asyncio.timeout(bench.longest_s):
            await device.stop()
            await device.stop()
        await asyncio.wait([waiting], timeout=bench.longest_s)
        hold(waiting.done(), "who waits for the arrival waits on after a stop")
        waiting.exception()
        await asyncio.sleep(bench.settle_s)
        first = await device.state()
        await asyncio.sleep(0.1)
        second = await device.state()
        for one, two, (name, unit) in zip(
            first.actuators, second.actuators, bench.axes, strict=True
        ):
            drift = abs(one.position - two.position)
            hold(drift < NEAR[unit], f"{name} still moves after a stop")
        await device.enable()
        await moved(device, bench, 0)


async def _names_channels(bench: MovingBench) -> None:
    async with connected(bench, enabled=False) as device:
        channels = await device.channels()
        hold(set(channels) <= set(device.can.channels), f"channels {sorted(channels)}")
        hold(all(map(math.isfinite, channels.values())), f"channels are {channels}")


async def _homes(bench: MovingBench) -> None:
    async with connected(bench, enabled=True) as device:
        name = bench.axes[0][0]
        async with asyncio.timeout(bench.longest_s):
            await device.home(name)
        hold((await device.state()).actuators[0].homed, "home() leaves it without reference")
        error = await refuses(device.home("no such"), bench.longest_s, "homing nobody")
        hold(isinstance(error, Refused), f"homing nobody ends in {error!r}")


async def _notices_silence(bench: MovingBench) -> None:
    assert bench.silence is not None
    async with connected(bench, enabled=False) as device:
        await bench.silence()
        await refuses(device.enable(), bench.longest_s, "a silent device")


async def _closes(bench: MovingBench) -> None:
    async with connected(bench, enabled=False) as device:
        async with asyncio.timeout(bench.longest_s):
            await device.close()
            await device.close()
        error = await refuses(device.enable(), bench.longest_s, "a call after the end")
        hold(isinstance(error, DeviceError), f"a call after the end ends in {error!r}")


MOVING_LAWS: tuple[Law[Any], ...] = (
    Law("it says who it is and what it can, and stands still", _says_who_it_is),
    Law("off, it refuses to move", _switches),
    Law("it refuses what it cannot reach, and goes on", _refuses_what_it_cannot_reach),
    Law("a stop ends every move", _stops),
    Law("channels are those that it names", _names_channels),
    Law("it finds its reference", _homes, ("homes",)),
    Law("silence is a fault before a deadline", _notices_silence, ("silence",)),
    Law("after the end nothing answers, nothing hangs", _closes),
)
