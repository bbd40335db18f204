"""What a routine works with: the devices, the journal, the plan, and what is known by now."""

import asyncio
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from app.errors import GateRefused
from app.files.pose_table import Pose
from app.files.site import Site
from app.files.site_limits import Limits
from app.session.events import (
    AlarmRaised,
    Event,
    FrameFound,
    PromptAnswered,
    PromptNeeded,
    ReadingRejected,
    Released,
    Suspended,
)
from app.session.hands import nobody_to_ask
from app.session.journal import PARAMETERS, SMRS, Journal
from app.session.plan import Plan
from app.session.rows import NewRow
from app.session.seen import Seen
from app.session.station import Station
from calib.arrays import Array
from calib.frames import Frame, nest_in_base
from drivers.errors import DeviceError
from drivers.interface import Alarm, Gauge, MotionController, Tracker

Point = tuple[float, float, float]


@dataclass
class Memory:
    """What this process knows and no journal holds: of the devices, and what was worked out."""

    frame: Frame
    """The base in the tracker's frame: as the site says, or fitted to what the journal holds."""
    frame_found: bool = False
    base: FrameFound | None = None
    """How the base was found, where the journal tells."""
    verified: bool = True
    """Whether the last reference still holds; False after whatever may have moved things."""
    aimed_at: str = ""
    """Nest that the beam is on; empty: not known."""
    standing_at: str | None = None
    """Label of the pose where the machine stands; None: ask the controller first."""
    q: tuple[float, ...] = ()
    arrived_s: float = 0.0
    delay_s: float = 0.0
    """Between the last arrival and the reading after it: how long it is to settle next time."""
    settled: bool = False
    channels: tuple[float, dict[str, float]] = field(default_factory=lambda: (0.0, {}))
    """When the channels were last asked for (machine s), and the answer."""
    spanned: tuple[str, str] | None = None
    """Nests between which the gauge is set; empty: it is off; None: not known."""
    seen: Seen = field(default_factory=Seen)
    """By which the next reading is judged."""


@dataclass(frozen=True)
class Done:
    """How a step ended: a line for the operator, data for the journal, and its reading.

    ``news`` is told once all of that is in the journal, and not before.
    """

    summary: str
    result: Mapping[str, Any] = field(default_factory=dict)
    reading: NewRow | None = None
    news: tuple[Event, ...] = ()


class LeftOut(Exception):
    """The operator leaves a step out; why is its text."""


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
        by_gauge = station.site.gauge is not None
        self.memory = Memory(Frame.of((0.0,) * 6 if by_gauge else station.site.tracker.frame))
        self.step = ""
        self.attempt = 0
        self.guarded = False
        """Whether standing faults end the session: from the moment when old ones are cleared."""
        self.losses = 0
        self._prompts: dict[str, tuple[tuple[str, ...], asyncio.Future[str]]] = {}
        """What each open question may be answered with (empty: anything), and its answer."""
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

    @property
    def gauge(self) -> Gauge:
        """The gauge."""
        return self.station.gauge

    def pose(self, label: str) -> Pose:
        """Look up a pose by its label; ``home`` is the machine's own."""
        return self.plan.poses.get(label, self.site.machine.home)

    # what the journal knows

    @property
    def smr_in(self) -> dict[int, str]:
        """Nest where each SMR was last brought, as far as anybody said."""
        return {int(smr): nest for smr, nest in self.journal.meta(SMRS, {}).items()}

    def smr_brought(self, smr: int, nest: str) -> None:
        """Remember where an SMR was brought."""
        self.journal.set_meta(SMRS, {str(k): n for k, n in {**self.smr_in, smr: nest}.items()})

    @property
    def controller_parameters(self) -> dict[str, float]:
        """Parameters that the controller held when the session connected."""
        held: dict[str, float] = self.journal.meta(PARAMETERS, {})
        return held

    def first_references(self) -> dict[str, Point]:
        """Each base nest as it was first read from the present stand (tracker frame, mm)."""
        return {nest: seen[0] for nest, seen in self.journal.seen(self.site.base_nests).items()}

    def last_references(self) -> dict[str, Point]:
        """Each base nest as it was last read (tracker frame, mm)."""
        return {nest: seen[-1] for nest, seen in self.journal.seen(self.site.base_nests).items()}

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

    # asking

    async def ask(
        self,
        text: str,
        choices: tuple[str, ...],
        default: str | None = None,
        fault: DeviceError | None = None,
        typed: str = "",
    ) -> str:
        """Ask the operator; ``typed`` says what may be answered instead of a choice, if anything.

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
        self._prompts[prompt] = (() if typed else choices, answer)
        self.tell(PromptNeeded(prompt, text, choices, default, typed))
        given = ""
        try:
            given = await answer
            self.note("answer", f"{text} -> {given}")
        finally:
            del self._prompts[prompt]
            self.tell(PromptAnswered(prompt, given))
        return given

    def answer(self, prompt: str, choice: str) -> None:
        """Answer a prompt; raises :class:`GateRefused` for what was not offered."""
        if prompt not in self._prompts:
            return  # somebody else was first
        choices, future = self._prompts[prompt]
        if choices and choice not in choices:
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
