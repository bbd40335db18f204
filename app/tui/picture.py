"""What the screens show of a job: the session's events, folded into one picture.

Nothing here is the truth: the journal is. A picture can be thrown away and made again from a
session (:meth:`Picture.of_session`) and the events that follow.
"""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, Literal

from app.session import events as ev
from app.session.gauge_rows import GAUGE, before, numbers
from app.session.session import Session
from app.tui.wording import micro
from drivers.interface import Alarm

KEPT = 2000
SCATTER_KEPT = 240

RunState = Literal["idle", "running", "paused", "waiting", "stopped", "fault", "finished"]
StepMark = Literal["planned", "started", "done", "failed", "skipped"]
Level = Literal["info", "good", "warn", "bad"]


@dataclass
class StepLine:
    """One line of the step list."""

    id: str
    says: str
    state: str = "planned"
    note: str = ""


@dataclass(frozen=True)
class Point:
    """A reading as the plots need it: how far from its prediction, and how sure, mm (rad).

    Readings taken before the base was found in the tracker's frame are not among them: they would
    only show how roughly the tracker was put down.
    """

    number: int
    pose: str
    nest: str
    miss_mm: float
    sigma_mm: float


@dataclass(frozen=True)
class LogLine:
    """One line of the log; ``time_s`` is machine time since the start of the run."""

    time_s: float | None
    level: Level
    text: str


@dataclass(frozen=True)
class Trouble:
    """Something to put on the banner: what happened, and what to do."""

    what: str
    remedy: str
    level: Literal["warn", "bad"] = "bad"
    passing: bool = False
    """It answers a key and says nothing of the machine: the next key takes it away."""


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
                name = _ends(row.nest, row.raw[GAUGE]["nest2"])
                self.points.append(Point(len(self.points) + 1, row.pose, name, off, sigma))
            return
        if not work.memory.frame_found:
            return
        for row in rows:
            if row.status == "good" and row.xyz is not None and row.covariance is not None:
                miss = math.dist(row.xyz, work.predict(row.nest, row.pose))
                sigma = math.sqrt(sum(row.covariance[:3]))
                number = len(self.points) + 1
                self.points.append(Point(number, row.pose, row.nest, miss, sigma))

    def tell(self, event: ev.Event) -> None:
        """Fold one event in; this is the session's observer."""
        fold = _FOLDS.get(type(event))
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
        self.say_trouble(what, remedy)
        self.trouble = Trouble(micro(what), micro(remedy), passing=True)

    def pass_on(self) -> None:
        """Take the answer to the last key away."""
        if self.trouble is not None and self.trouble.passing:
            self.trouble = None
            self.revision += 1

    @property
    def busy(self) -> bool:
        """Whether a job is under way."""
        return self.run in ("running", "paused", "waiting")


def _note(result: Any) -> str:
    return str(result.get("what") or result.get("why") or "")


def _connected(picture: Picture, event: ev.Connected) -> None:
    picture.connected[event.role] = event
    who = event.identity
    picture.write(
        f"{event.role} connected: {who.vendor} {who.product} {who.serial} at {event.address}",
        "good",
    )


def _disconnected(picture: Picture, event: ev.Disconnected) -> None:
    picture.connected.pop(event.role, None)
    picture.states = None
    picture.write(f"{event.role} disconnected")


def _states(picture: Picture, event: ev.DeviceStates) -> None:
    picture.states = event


def _alarm(picture: Picture, event: ev.AlarmRaised) -> None:
    alarm = event.alarm
    before = next((old for _, old in reversed(picture.alarms) if old.device == alarm.device), None)
    if alarm == before and picture.run != "running":
        return  # a device that says the same again and again is heard once
    picture.alarms.append((event.time_s, alarm))
    level: Level = "bad" if alarm.fault else "warn"
    text = f"{alarm.device}: {alarm.what}"
    picture.write(f"{text}. {alarm.remedy}" if alarm.remedy else text, level, event.time_s)
    if alarm.fault:
        picture.trouble = Trouble(micro(text), micro(alarm.remedy))


def _step_started(picture: Picture, event: ev.StepStarted) -> None:
    picture.current, picture.attempt = event.index, event.attempt
    _mark(picture, event.index, "started", "")
    if picture.run != "paused":
        picture.run = "running"


def _step_done(picture: Picture, event: ev.StepDone) -> None:
    _mark(picture, event.index, "done", event.summary)
    picture.write(event.summary, "info", event.time_s)


def _step_failed(picture: Picture, event: ev.StepFailed) -> None:
    _mark(picture, event.index, "failed", event.what)
    picture.write(f"{event.step}: {event.what}", "bad", event.time_s)


def _step_skipped(picture: Picture, event: ev.StepSkipped) -> None:
    _mark(picture, event.index, "skipped", event.why)
    picture.write(f"{event.step} skipped: {event.why}", "warn", event.time_s)


def _mark(picture: Picture, index: int, state: StepMark, note: str) -> None:
    if index < len(picture.steps):
        picture.steps[index].state = state
        picture.steps[index].note = note


def _progress(picture: Picture, event: ev.Progress) -> None:
    picture.progress = event


def _pose(picture: Picture, event: ev.PoseCommanded) -> None:
    picture.pose = event
    picture.settling = None


def _live(picture: Picture, event: ev.LivePose) -> None:
    picture.live = event


def _scatter(picture: Picture, event: ev.LiveScatter) -> None:
    picture.scatter.append(event)
    picture.settling = event


def _reading(picture: Picture, event: ev.ReadingTaken) -> None:
    if picture.frame is not None or picture.points:
        number = len(picture.points) + 1
        picture.points.append(
            Point(number, event.pose_label, event.nest, event.miss_mm, event.sigma_mm)
        )
    picture.last_reading = event


def _number(picture: Picture, event: ev.NumberTaken) -> None:
    name, number = _ends(event.nest, event.nest2), len(picture.points) + 1
    off = abs(event.value - event.expected)
    picture.points.append(Point(number, event.pose_label, name, off, event.sigma))
    picture.last_number = event


def _ends(nest: str, nest2: str) -> str:
    """What is read: a nest, or a pair."""
    return f"{nest}-{nest2}" if nest2 else nest


def _rejected(picture: Picture, event: ev.ReadingRejected) -> None:
    picture.rejected += 1
    picture.write(
        f"reading of nest {event.nest} at pose {event.pose_label} set aside: {event.why}",
        "warn",
        event.time_s,
    )


def _frame(picture: Picture, event: ev.FrameFound) -> None:
    picture.frame = event
    picture.write(
        f"base found in the tracker's frame from nests {', '.join(event.nests)}, "
        f"RMS {event.rms_mm * 1000:.1f} um",
        "good",
    )


def _drift(picture: Picture, event: ev.DriftChecked) -> None:
    picture.drift = event
    fine = event.shift_mm <= event.limit_mm
    picture.write(
        f"drift {event.shift_mm * 1000:.1f} um (limit {event.limit_mm * 1000:.0f})",
        "info" if fine else "warn",
        event.time_s,
    )


def _prompt(picture: Picture, event: ev.PromptNeeded) -> None:
    picture.prompt = replace(event, text=micro(event.text))
    picture.write(f"asked: {event.text}")


def _answered(picture: Picture, event: ev.PromptAnswered) -> None:
    if picture.prompt is not None and picture.prompt.prompt == event.prompt:
        picture.prompt = None
    if event.answer:
        picture.write(f"answered: {event.answer}")


def _suspended(picture: Picture, event: ev.Suspended) -> None:
    picture.run = "waiting"
    picture.say_trouble(event.why, event.remedy, "warn")


def _released(picture: Picture, event: ev.Released) -> None:
    picture.run = "running"
    picture.trouble = None
    picture.write(f"goes on: {event.why}", "good")


def _paused(picture: Picture, event: ev.Paused) -> None:
    picture.run = "paused"
    picture.write("paused by the operator")


def _resumed(picture: Picture, event: ev.Resumed) -> None:
    picture.run = "running"
    picture.write("goes on")


def _stopped(picture: Picture, event: ev.Stopped) -> None:
    picture.run = "stopped"
    picture.prompt = None
    picture.say_trouble(
        "Stopped by the operator; the machine stands still",
        f"g on the Measure screen goes on where it stopped. {event.remedy}",
        "warn",
    )


def _fault(picture: Picture, event: ev.Fault) -> None:
    picture.run = "fault"
    picture.prompt = None
    safe = "" if event.safe else " The stop was NOT confirmed: use the emergency stop."
    picture.say_trouble(event.what + safe, f"{event.remedy} (or g on the Measure screen)")


def _finished(picture: Picture, event: ev.Finished) -> None:
    picture.run = "finished"
    picture.run_folder = event.run_folder
    picture.trouble = None
    picture.write(f"finished: {event.readings} readings in {event.run_folder}", "good")


def _gate(picture: Picture, event: ev.GateChecked) -> None:
    picture.gates.append(replace(event, says=micro(event.says), unit=micro(event.unit)))
    picture.write(
        f"gate {event.gate}: {'passed' if event.passed else 'REFUSED'}, {event.says}",
        "info" if event.passed else "bad",
    )


def _stage(picture: Picture, event: ev.WriteBackStage) -> None:
    picture.stages.append(replace(event, says=micro(event.says)))
    bad = event.stage == "restore-failed"
    picture.write(f"write-back: {event.says}", "bad" if bad else "info")


_FOLDS: dict[type[ev.Event], Callable[[Picture, Any], None]] = {
    ev.Connected: _connected,
    ev.Disconnected: _disconnected,
    ev.DeviceStates: _states,
    ev.AlarmRaised: _alarm,
    ev.StepStarted: _step_started,
    ev.StepDone: _step_done,
    ev.StepFailed: _step_failed,
    ev.StepSkipped: _step_skipped,
    ev.Progress: _progress,
    ev.PoseCommanded: _pose,
    ev.LivePose: _live,
    ev.LiveScatter: _scatter,
    ev.ReadingTaken: _reading,
    ev.NumberTaken: _number,
    ev.ReadingRejected: _rejected,
    ev.FrameFound: _frame,
    ev.DriftChecked: _drift,
    ev.PromptNeeded: _prompt,
    ev.PromptAnswered: _answered,
    ev.Suspended: _suspended,
    ev.Released: _released,
    ev.Paused: _paused,
    ev.Resumed: _resumed,
    ev.Stopped: _stopped,
    ev.Fault: _fault,
    ev.Finished: _finished,
    ev.GateChecked: _gate,
    ev.WriteBackStage: _stage,
}
