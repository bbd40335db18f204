"""What a routine works with: the devices, the journal, the plan, and what is known by now."""

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from app.errors import GateRefused
from app.files.pose_table import Pose
from app.files.site import Limits, Site
from app.session.events import (
    AlarmRaised,
    Event,
    PromptAnswered,
    PromptNeeded,
    ReadingRejected,
    Released,
    Suspended,
)
from app.session.hands import nobody_to_ask
from app.session.journal import Journal, NewRow
from app.session.plan import Plan
from app.session.station import Station
from calib.arrays import Array
from calib.frames import Frame, nest_in_base
from drivers.errors import DeviceError
from drivers.interface import Alarm, MotionController, Tracker

HOME = "home"


@dataclass
class Memory:
    """What the session knows by now; all of it can be had again from journal and devices."""

    frame: Frame
    frame_found: bool = False
    first_reference: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    last_reference: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    verified: bool = True
    """Whether the last reference still holds; False after whatever may have moved things."""
    smr_in: dict[int, str] = field(default_factory=dict)
    aimed_at: str = ""
    """Nest that the beam is on; empty: not known."""
    standing_at: str | None = None
    """Label of the pose where the machine stands; None: ask the controller first."""
    q: tuple[float, ...] = ()
    arrived_s: float = 0.0
    settled: bool = False
    channels: tuple[float, dict[str, float]] = field(default_factory=lambda: (0.0, {}))
    """When the channels were last asked for (machine s), and the answer."""
    controller_parameters: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Done:
    """How a step ended: a line for the operator, data for the journal, and its reading."""

    summary: str
    result: Mapping[str, Any] = field(default_factory=dict)
    reading: NewRow | None = None


class StartOver(Exception):
    """Base or tracker stand elsewhere than before: what was read is set aside, all begins anew."""


class Work:
    """One session's services, handed to each routine."""

    def __init__(
        self,
        station: Station,
        plan: Plan,
        journal: Journal,
        *,
        unattended: bool,
        expected: Mapping[str, float] | None = None,
    ) -> None:
        self.station = station
        self.plan = plan
        self.journal = journal
        self.unattended = unattended
        self.expected = expected
        self.clock = station.clock
        self.memory = Memory(Frame.of(station.site.tracker.frame))
        self.step = ""
        self.attempt = 0
        self.guarded = False
        """Whether standing faults end the session: from the moment when old ones are cleared."""
        self.losses = 0
        self.readings = sum(row.kind == "reading" for row in journal.rows())
        self._prompts: dict[str, tuple[tuple[str, ...], asyncio.Future[str]]] = {}
        self._asked = 0

    # shorthands

    @property
    def site(self) -> Site:
        """The site."""
        return self.station.site

    @property
    def limits(self) -> Limits:
        """What is normal at this site."""
        return self.station.site.limits

    @property
    def controller(self) -> MotionController:
        """The motion controller."""
        return self.station.controller

    @property
    def tracker(self) -> Tracker:
        """The tracker."""
        return self.station.tracker

    def pose(self, label: str) -> Pose:
        """Look up a pose by its label; ``home`` is the machine's own."""
        return self.plan.poses.get(label, self.site.machine.home)

    def journal_state(self, step: str) -> str:
        """State of a step by the journal."""
        found = self.journal.states().get(step)
        return found.state if found else "planned"

    # telling

    def tell(self, event: Event) -> None:
        """Tell the observers."""
        self.station.observers.tell(event)

    def alarm(self, device: str, what: str, remedy: str = "", *, fault: bool = False) -> None:
        """Tell of something to look at, and write it down."""
        self.note("alarm", f"{device}: {what}")
        self.tell(AlarmRaised(Alarm(device, what, remedy, fault), self.clock.now()))

    def note(self, kind: str, text: str) -> None:
        """Write a remark into the journal."""
        self.journal.note(kind, text, self.clock.now(), self.clock.utc())

    def suspended(self, why: str, remedy: str) -> None:
        """Tell that the job waits."""
        self.note("suspended", why)
        self.tell(Suspended(why, remedy))

    def released(self, why: str) -> None:
        """Tell that the job goes on."""
        self.note("released", why)
        self.tell(Released(why))

    def set_aside(self, row: NewRow) -> None:
        """Write a reading that is not to be used, with the reason."""
        self.journal.add_row(self.step, self.attempt, self.clock.utc(), row)
        self.tell(ReadingRejected(row.pose, row.nest, row.why, row.time_s))

    def start_over(self, why: str) -> None:
        """Set every reading aside; the plan's steps that took them are to be done again."""
        self.journal.invalidate(why, self.clock.now(), self.clock.utc())
        self.memory.frame_found = False
        self.memory.first_reference.clear()
        self.memory.last_reference.clear()
        self.readings = 0

    # asking

    async def ask(
        self,
        text: str,
        choices: tuple[str, ...],
        default: str | None = None,
        fault: DeviceError | None = None,
    ) -> str:
        """Ask the operator.

        Unattended, the answer is ``default``; where that is None, ``fault`` is raised.
        """
        if self.unattended:
            if default is None:
                raise fault or nobody_to_ask(text)
            self.note("unattended", f"{text} -> {default}")
            return default
        self._asked += 1
        prompt = f"prompt-{self._asked}"
        answer: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        self._prompts[prompt] = (choices, answer)
        self.tell(PromptNeeded(prompt, text, choices, default))
        given = ""
        try:
            given = await answer
        finally:
            del self._prompts[prompt]
            self.tell(PromptAnswered(prompt, given))
        self.note("answer", f"{text} -> {given}")
        return given

    def answer(self, prompt: str, choice: str) -> None:
        """Answer a prompt; raises :class:`GateRefused` for what was not offered."""
        if prompt not in self._prompts:
            return  # somebody else was first
        choices, future = self._prompts[prompt]
        if choice not in choices:
            raise GateRefused(f'"{choice}" is not an answer', remedy=f"Choose {choices}")
        if not future.done():
            future.set_result(choice)

    # predicting

    def predict(self, nest: str, label: str) -> Array:
        """Where an SMR in a nest should be seen: tracker frame, mm, with the machine at a pose."""
        return self.memory.frame.apply(self.in_base(nest, label))

    def in_base(self, nest: str, label: str) -> Array:
        """Place of a nest in the base frame, mm."""
        if nest in self.site.base_nests:
            return nest_in_base((0.0,) * 6, self.site.base_nests[nest])
        return nest_in_base(self.pose(label), self.site.platform_nests[nest])
