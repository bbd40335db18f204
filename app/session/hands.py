"""Who carries SMRs and sets a gauge: a person who is asked, or a mock's control socket."""

import asyncio
import json
from collections.abc import Awaitable, Callable
from typing import Any, Protocol

from app.errors import StoppedByOperator
from app.files.site import Site
from drivers.errors import ConnectFailed, LinkLost, NoTarget, Refused, Silence

Ask = Callable[[str, tuple[str, ...]], Awaitable[str]]


class Carrier(Protocol):
    """Brings SMRs to nests."""

    async def carry(self, smr: int, nest: str, ask: Ask, why: str = "") -> None:
        """Bring an SMR to a nest and come back when it is there (to the carrier's belief).

        ``why`` says what was wrong where it is not the first time.
        """

    async def span(self, nest: str, nest2: str, ask: Ask) -> None:
        """Set the gauge between a nest of the platform and one of the base."""

    async def take_off(self, ask: Ask) -> None:
        """Take the gauge off: the machine moves."""


class PersonCarries:
    """The operator is asked and says when it is done."""

    def __init__(self, smrs: int) -> None:
        self._smrs = smrs

    async def span(self, nest: str, nest2: str, ask: Ask) -> None:
        """Have it set; raises :class:`StoppedByOperator`."""
        text = f"Set the gauge between nest {nest} (platform) and nest {nest2} (base)."
        if await ask(text, ("done", "stop")) == "stop":
            raise StoppedByOperator(f"stopped when the gauge was to be set between {nest}, {nest2}")

    async def take_off(self, ask: Ask) -> None:
        """Have it taken off; raises :class:`StoppedByOperator`."""
        text = "Take the gauge off, if it is set, and step back: the machine moves."
        if await ask(text, ("done", "stop")) == "stop":
            raise StoppedByOperator("stopped when the gauge was to be taken off")

    async def carry(self, smr: int, nest: str, ask: Ask, why: str = "") -> None:
        """Ask; raises :class:`StoppedByOperator` if the answer is to stop."""
        which = f"SMR {smr}" if self._smrs > 1 else "the SMR"
        text = f"{why}. " if why else ""
        text += f"Put {which} into nest {nest}, keeping the beam on it if you can, then step back."
        if await ask(text, ("done", "stop")) == "stop":
            raise StoppedByOperator(f"stopped when {which} was to be carried to nest {nest}")


class MockCarries:
    """The mock's control socket moves the SMR."""

    def __init__(self, host: str, port: int) -> None:
        self._control = MockControl(host, port)

    async def carry(self, smr: int, nest: str, ask: Ask, why: str = "") -> None:
        """Tell the mock."""
        await self._control.call("carry", smr=smr, nest=nest)

    async def span(self, nest: str, nest2: str, ask: Ask) -> None:
        """Tell the mock."""
        await self._control.call("span", nest=nest, nest2=nest2)

    async def take_off(self, ask: Ask) -> None:
        """Tell the mock."""
        await self._control.call("take-off")


class MockControl:
    """One JSON object a line to the mock's control socket, one back; a deadline for each."""

    def __init__(self, host: str, port: int, deadline_s: float = 10.0) -> None:
        self.address = f"{host}:{port}"
        self._host, self._port, self._deadline = host, port, deadline_s

    async def call(self, command: str, **arguments: Any) -> dict[str, Any]:
        """Send one command and return the answer; raises a DeviceError if it says no."""
        device = f"mock control {self.address}"
        try:
            async with asyncio.timeout(self._deadline):
                reader, writer = await asyncio.open_connection(self._host, self._port)
                try:
                    request = json.dumps({"do": command, **arguments})
                    writer.write(request.encode() + b"\n")
                    await writer.drain()
                    line = await reader.readline()
                finally:
                    writer.close()
        except TimeoutError as error:
            raise Silence(
                f'no answer to "{command}"', device=device, remedy="Is the mock still running?"
            ) from error
        except OSError as error:
            raise ConnectFailed(
                f"nobody answers ({error})", device=device, remedy="Is the mock still running?"
            ) from error
        if not line:
            raise LinkLost(
                f'the link closed during "{command}"',
                device=device,
                remedy="Is the mock still running?",
            )
        answer: dict[str, Any] = json.loads(line)
        if not answer.get("ok", False):
            raise Refused(
                str(answer.get("error", answer)),
                device=device,
                remedy="See which nests and SMRs the mock has: pkmcal mock --help",
            )
        return answer


def carrier_of(site: Site) -> Carrier:
    """Who carries at this site."""
    if site.hands.kind == "mock":
        return MockCarries(site.hands.host, site.hands.port)
    return PersonCarries(site.hands.smrs)


def nobody_to_ask(text: str) -> NoTarget:
    """What an unattended session says where a person is needed."""
    return NoTarget(
        f"a person is needed: {text}",
        device="operator",
        remedy="Run in a terminal, or say in the site file who carries SMRs ([hands])",
    )
