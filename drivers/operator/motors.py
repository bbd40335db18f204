"""Actuators that a person sets: by hand wheels, or at the panel of another controller."""

import asyncio
import math
from collections.abc import Awaitable, Callable, Sequence

from drivers.errors import LinkLost, Refused
from drivers.interface import ActuatorState, Alarm, ControllerCan, ControllerState, Identity
from drivers.kind import ActuatorFacts
from drivers.operator.asked import unless_stopped

Ask = Callable[[str, tuple[str, ...], str], Awaitable[str]]
"""Brings a question to the person: its text, the answers to choose from, and what may be typed."""
DONE, CANNOT = "done", "cannot be reached"
DIGITS = {"mm": 4, "rad": 6}
NEAR = 0.02


class PersonMoves:
    """A person as :class:`drivers.interface.Motors`; waits for an answer, however long it takes.

    The machine is believed to stand at home when this begins, and where it was last said to be
    afterwards. Whoever uses it sets :attr:`ask` to what brings questions to the person.

    Parameters
    ----------
    actuators : sequence of ActuatorFacts
    serial : str
        Serial number of the machine, as the site file says.
    near : float
        Part of each range by which values that the person types may differ from those asked for.
    """

    def __init__(
        self, actuators: Sequence[ActuatorFacts], serial: str = "", near: float = NEAR
    ) -> None:
        self.identity = Identity("operator", product="moved by a person", serial=serial)
        self.can = ControllerCan(parameters=False, homes=False)
        self.ask: Ask | None = None
        self._actuators = tuple(actuators)
        self._near = near
        self._at = self._to = tuple(actuator.home for actuator in actuators)
        self._enabled = False
        self._closed = False
        self._stopped = asyncio.Event()

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """A person says nothing unasked here."""

    def check(self) -> None:
        """No fault stands."""

    async def state(self) -> ControllerState:
        """Where the machine was last said to be, and where it is to go."""
        moving = self._at != self._to
        said = "to be moved by hand" if moving else "stands"
        actuators = tuple(
            ActuatorState(one.name, at, to, said, at != to, True)
            for one, at, to in zip(self._actuators, self._at, self._to, strict=True)
        )
        return ControllerState(actuators, moving, self._enabled)

    async def enable(self) -> None:
        """Let moves be asked for; raises LinkLost after the end."""
        if self._closed:
            raise LinkLost(
                "the session with the operator has ended",
                device=self.identity.kind,
                remedy="Connect again.",
            )
        self._enabled = True

    async def disable(self) -> None:
        """Let no move be asked for."""
        self._enabled = False

    async def clear_faults(self) -> None:
        """There are none."""

    async def home(self, actuator: str) -> None:
        """Refuse: references are the person's business."""
        raise Refused(
            "a machine that a person moves has no reference move",
            device=self.identity.kind,
            remedy=f"Bring {actuator} to its reference by hand",
        )

    async def move_actuators(self, q: tuple[float, ...]) -> None:
        """Remember what :meth:`wait_arrived` is to ask for.

        Raises
        ------
        Refused
            For values that are not one for each actuator within its limits.
        """
        if not self._enabled:
            raise Refused("is not enabled", device=self.identity.kind, remedy="Enable it first")
        if len(q) != len(self._actuators):
            raise Refused(f"{len(q)} values", device=self.identity.kind, remedy="One an actuator")
        for one, value in zip(self._actuators, q, strict=True):
            if not one.limits[0] <= value <= one.limits[1]:
                raise Refused(
                    f"{one.name} = {value:.4f} {one.unit} is outside {one.limits}",
                    device=self.identity.kind,
                    remedy="Nothing is asked for; choose another pose",
                )
        self._stopped.clear()
        self._to = tuple(q)

    async def wait_arrived(self, timeout: float) -> None:
        """Ask the person to move the machine; a person has no deadline, a stop ends it.

        The person says that it is there, or types the actuator values that were really reached:
        those count from then on. Values that cannot be are asked for again, with the reason.

        Raises
        ------
        Refused
            If the machine cannot be brought there, or there is nobody to ask.
        """
        if self._at == self._to:
            return
        if self.ask is None:
            raise Refused(
                "nobody is there to move the machine",
                device=self.identity.kind,
                remedy="Measure in a terminal, with somebody at the machine",
            )
        wrong = ""
        while (said := await self._answer(self.ask, wrong)) != DONE:
            if said == CANNOT:
                self._to = self._at
                raise Refused(
                    "the operator could not bring the machine there",
                    device=self.identity.kind,
                    remedy="Skip the pose, or choose others with pkmcal poses",
                )
            try:
                self._to = self._typed(said)
            except ValueError as impossible:
                wrong = f"{impossible}. "
            else:
                break
        self._at = self._to

    def _typed(self, said: str) -> tuple[float, ...]:
        """Actuator values that a person typed; raises ValueError that says what is wrong."""
        words = said.replace(";", " ").replace("=", " = ").split()
        names = [one.name for one in self._actuators]
        if "=" in words:
            named = dict(zip(words[0::3], words[2::3], strict=False))
            if words[1::3] != ["="] * len(names) or list(named) != names:
                raise ValueError(
                    f"Type {', '.join(f'{name}=...' for name in names)}, or values alone"
                )
            words = list(named.values())
        if len(words) != len(names):
            raise ValueError(f"{len(words)} values were typed, there are {len(names)} actuators")
        values = tuple(map(_number, words))
        for one, value, asked in zip(self._actuators, values, self._to, strict=True):
            low, high = one.limits
            if not low <= value <= high:
                raise ValueError(
                    f"{one.name} = {value:g} {one.unit} is outside {low:g} to {high:g}"
                )
            if abs(value - asked) > self._near * (high - low):
                raise ValueError(
                    f"{one.name} = {value:g} {one.unit} is {abs(value - asked):.4g} from what was "
                    "asked for: a slip of the pen, or another pose"
                )
        return values

    async def _answer(self, ask: Ask, before: str) -> str:
        """The person's answer; raises Refused if a stop comes before it."""
        text = f"{before}Move the machine to {self._wanted()}."
        typed = f"the values reached: {' '.join(one.name for one in self._actuators)}"
        said = await unless_stopped(ask(text, (DONE, CANNOT), typed), self._stopped)
        if said is not None:
            return said
        raise Refused("the move was stopped", device=self.identity.kind, remedy="Command it again")

    def _wanted(self) -> str:
        return ", ".join(
            f"{one.name} = {value:.{DIGITS[one.unit]}f} {one.unit}"
            for one, value in zip(self._actuators, self._to, strict=True)
        )

    async def stop(self) -> None:
        """Nothing moves by itself; what was asked for is not asked for any more."""
        self._to = self._at
        self._stopped.set()

    async def channels(self) -> dict[str, float]:
        """Nothing is measured here."""
        return {}

    async def close(self) -> None:
        """There is no link; nobody is asked any more."""
        self._enabled, self._closed = False, True
        self._stopped.set()


def _number(word: str) -> float:
    """A finite number; raises ValueError in words."""
    try:
        value = float(word)
    except ValueError:
        value = math.nan
    if not math.isfinite(value):
        raise ValueError(f'"{word}" is no number (write 12.5, with a point)')
    return value
