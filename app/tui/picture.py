"""What the screens show of a job: the session's events, folded into one picture.

Nothing here is the truth: the journal is. A picture can be thrown away and made again from a
session (:meth:`Picture.of_session`) and the events that follow.
"""

import math
from collections import deque
from dataclasses import dataclass, field
from typing import Any, Literal

from app.session import events as ev
from app.session.gauge_rows import GAUGE, before, numbers
from app.session.session import Session
from app.tui.folding import FOLDS
from app.tui.parts import (
    Level,
    LogLine,
    Point,
    RunState,
    StepLine,
    Trouble,
    ends,
    reading_point,
    vector,
)
from app.tui.wording import micro
from drivers.interface import Alarm

KEPT = 2000
SCATTER_KEPT = 240


@dataclass
class Picture:
    """Everything that a screen needs to draw; ``revision`` grows with each change."""

    revision: int = 0
    run: RunState = "idle"
    doing: str = ""
    purpose: str = ""
    title: str = ""
    steps: list[StepLine] = field(default_factory=list)
    current: int | None = None
    attempt: int = 0
    progress: ev.Progress | None = None
    connected: dict[str, ev.Connected] = field(default_factory=dict)
    states: ev.DeviceStates | None = None
    alarms: "deque[tuple[float, Alarm]]" = field(default_factory=lambda: deque(maxlen=KEPT))
    log: "deque[LogLine]" = field(default_factory=lambda: deque(maxlen=KEPT))
    logged: int = 0
    pose: ev.PoseCommanded | None = None
    live: ev.LivePose | None = None
    scatter: "deque[ev.LiveScatter]" = field(default_factory=lambda: deque(maxlen=SCATTER_KEPT))
    settling: ev.LiveScatter | None = None
    points: list[Point] = field(default_factory=list)
    last_reading: ev.ReadingTaken | None = None
    last_rough: bool = False
    """The last reading was taken before the base was found: how far it is off says nothing."""
    last_number: ev.NumberTaken | None = None
    rejected: int = 0
    frame: ev.FrameFound | None = None
    drift: ev.DriftChecked | None = None
    prompt: ev.PromptNeeded | None = None
    trouble: Trouble | None = None
    run_folder: str = ""
    gates: list[ev.GateChecked] = field(default_factory=list)
    stages: list[ev.WriteBackStage] = field(default_factory=list)

    def begin(self, session: Session) -> None:
        """Show another session: its steps and the readings that its journal holds already."""
        self.steps = [
            StepLine(step.id, step.says, state.state, _note(state.result))
            for step, state in session.steps()
        ]
        self.purpose, self.title = session.plan.purpose, session.plan.title
        self.run, self.current, self.progress, self.trouble = "running", None, None, None
        self.points, self.rejected, self.last_reading, self.last_number = [], 0, None, None
        self.frame = self.drift = self.pose = self.live = self.settling = None
        self.scatter.clear()
        self.revision += 1

    def recall(self, session: Session) -> None:
        """Show the readings that the journal of a session holds already, where the base is known.

        To be called when the session has begun to run: it has recalled the base frame then.
        """
        work = session.work
        rows = [row for row in session.journal.rows(good_only=False) if row.kind == "reading"]
        self.rejected = sum(row.status != "good" for row in rows)
        self.frame = work.memory.base
        if work.site.gauge is not None:
            zero, sigma = work.site.gauge.zero_of(before(session.journal)), work.site.gauge.sigma
            for row in numbers(session.journal):
                off = abs(row.raw[GAUGE]["value"] - row.raw[GAUGE]["expected"] - zero)
                name = ends(row.nest, row.raw[GAUGE]["nest2"])
                self.points.append(Point(len(self.points) + 1, row.pose, name, off, sigma))
            return
        if not work.memory.frame_found:
            return
        for row in rows:
            if row.status == "good" and row.xyz is not None and row.covariance is not None:
                there = vector(work.predict(row.nest, row.pose))
                sigma = math.sqrt(sum(row.covariance[:3]))
                number, frame = len(self.points) + 1, work.memory.frame.numbers()
                self.points.append(
                    reading_point(number, row.pose, row.nest, row.xyz, there, sigma, frame)
                )

    def tell(self, event: ev.Event) -> None:
        """Fold one event in; this is the session's observer."""
        fold = FOLDS.get(type(event))
        if fold is not None:
            fold(self, event)
            self.revision += 1

    def write(self, text: str, level: Level = "info", time_s: float | None = None) -> None:
        """Add a line to the log."""
        self.log.append(LogLine(time_s, level, micro(text)))
        self.logged += 1
        self.revision += 1

    def say_trouble(self, what: str, remedy: str, level: Literal["warn", "bad"] = "bad") -> None:
        """Put something on the banner and into the log."""
        self.trouble = Trouble(micro(what), micro(remedy), level)
        self.write(f"{what}. {remedy}" if remedy else what, level)

    def refuse(self, what: str, remedy: str) -> None:
        """Say why a key did nothing, until another one is pressed."""
        stands = self.trouble
        if stands is not None and stands.passing:
            stands = stands.over
        self.say_trouble(what, remedy)
        self.trouble = Trouble(micro(what), micro(remedy), passing=True, over=stands)

    def pass_on(self) -> None:
        """Take the answer to the last key away; what stood on the banner before comes back."""
        if self.trouble is not None and self.trouble.passing:
            self.trouble = self.trouble.over
            self.revision += 1

    @property
    def busy(self) -> bool:
        """Whether a job is under way."""
        return self.run in ("running", "paused", "waiting")


def _note(result: Any) -> str:
    return str(result.get("what") or result.get("why") or "")
