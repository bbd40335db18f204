"""A gauge that a person reads off and types."""

import asyncio
from collections.abc import Awaitable, Callable

from drivers.errors import LinkError, Refused
from drivers.interface import Alarm, GaugeCan, GaugeReading, GaugeState, Identity
from drivers.lines.number import UNITS
from drivers.operator.asked import unless_stopped
from drivers.stopping import stopped

AskNumber = Callable[[str, str], Awaitable[str]]
"""Brings a question to the person: what was wrong before (or nothing), and what is to be typed."""


class PersonReads:
    """A person as :class:`drivers.interface.Gauge`; waits for an answer, however long it takes.

    Whoever uses it sets :attr:`ask` to what brings questions to the person.
    """

    def __init__(self, unit: str, decimal: str, name: str) -> None:
        self.identity = Identity("operator", product=name)
        self.can = GaugeCan(repeats=False, by_hand=True)
        self.ask: AskNumber | None = None
        self._unit, self._decimal = unit, decimal
        self._last = ""
        self._stopped = asyncio.Event()

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """A person says nothing unasked here."""

    def check(self) -> None:
        """No fault stands."""

    async def state(self) -> GaugeState:
        """What was typed last."""
        return GaugeState(True, self._last)

    async def read(self, dwell_s: float) -> GaugeReading:
        """Ask for the number until it is one; a person has no deadline, a stop ends it.

        Raises
        ------
        Refused
            If there is nobody to ask.
        LinkError
            After :meth:`stop`.
        """
        if self.ask is None:
            raise Refused(
                "nobody is there to read it off", device=self.identity.product,
                remedy="Measure in a terminal, with somebody at the gauge",
            )  # fmt: skip
        self._stopped.clear()
        wrong = ""
        while (value := self._number(said := await self._answer(self.ask, wrong))) is None:
            wrong = f'"{said}" is no number with decimals behind "{self._decimal}". '
        self._last = f"{said} {self._unit}"
        return GaugeReading(value, self._last)

    def _number(self, said: str) -> float | None:
        """What was typed, in mm or rad; None if it is no number."""
        text, other = said.strip(), "," if self._decimal == "." else "."
        text = text.removesuffix(self._unit).strip()
        if other in text or "_" in text:
            return None
        try:
            value = UNITS[self._unit] * float(text.replace(self._decimal, "."))
        except ValueError:
            return None
        return value if abs(value) < 1e9 else None

    async def _answer(self, ask: AskNumber, wrong: str) -> str:
        said = await unless_stopped(ask(wrong, f"the number in {self._unit}"), self._stopped)
        if said is not None:
            return said
        raise stopped(LinkError, self.identity.product)

    async def stop(self) -> None:
        """Nobody is waited for any more."""
        self._stopped.set()

    async def close(self) -> None:
        """There is no link."""
        self._stopped.set()
