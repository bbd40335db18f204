"""The session's events, one function each, folded into the picture that the screens draw."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from app.session import events as ev
from app.tui.parts import Level, Point, StepMark, Trouble, ends, reading_point
from app.tui.wording import micro

if TYPE_CHECKING:
    from app.tui.picture import Picture


def _connected(picture: "Picture", event: ev.Connected) -> None:
    picture.connected[event.role] = event
    who = event.identity
    picture.write(
        f"{event.role} connected: {who.vendor} {who.product} {who.serial} at {event.address}",
        "good",
    )


def _disconnected(picture: "Picture", event: ev.Disconnected) -> None:
    picture.connected.pop(event.role, None)
    picture.states = None
    picture.write(f"{event.role} disconnected")


def _states(picture: "Picture", event: ev.DeviceStates) -> None:
    picture.states = event


def _alarm(picture: "Picture", event: ev.AlarmRaised) -> None:
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


def _step_started(picture: "Picture", event: ev.StepStarted) -> None:
    picture.current, picture.attempt = event.index, event.attempt
    _mark(picture, event.index, "started", "")
    if picture.run != "paused":
        picture.run = "running"


def _step_done(picture: "Picture", event: ev.StepDone) -> None:
    _mark(picture, event.index, "done", event.summary)
    picture.write(event.summary, "info", event.time_s)


def _step_failed(picture: "Picture", event: ev.StepFailed) -> None:
    _mark(picture, event.index, "failed", event.what)
    picture.write(f"{event.step}: {event.what}", "bad", event.time_s)


def _step_skipped(picture: "Picture", event: ev.StepSkipped) -> None:
    _mark(picture, event.index, "skipped", event.why)
    picture.write(f"{event.step} skipped: {event.why}", "warn", event.time_s)


def _mark(picture: "Picture", index: int, state: StepMark, note: str) -> None:
    if index < len(picture.steps):
        picture.steps[index].state = state
        picture.steps[index].note = note


def _progress(picture: "Picture", event: ev.Progress) -> None:
    picture.progress = event


def _pose(picture: "Picture", event: ev.PoseCommanded) -> None:
    picture.pose = event
    picture.settling = None


def _live(picture: "Picture", event: ev.LivePose) -> None:
    picture.live = event


def _scatter(picture: "Picture", event: ev.LiveScatter) -> None:
    picture.scatter.append(event)
    picture.settling = event


def _reading(picture: "Picture", event: ev.ReadingTaken) -> None:
    picture.last_rough = picture.frame is None
    if picture.frame is not None:
        number, frame = len(picture.points) + 1, picture.frame.frame
        picture.points.append(
            reading_point(
                number, event.pose_label, event.nest, event.xyz, event.predicted, event.sigma_mm,
                frame,
            )
        )  # fmt: skip
    picture.last_reading = event


def _number(picture: "Picture", event: ev.NumberTaken) -> None:
    name, number = ends(event.nest, event.nest2), len(picture.points) + 1
    off = abs(event.value - event.expected)
    picture.points.append(Point(number, event.pose_label, name, off, event.sigma))
    picture.last_number = event


def _rejected(picture: "Picture", event: ev.ReadingRejected) -> None:
    picture.rejected += 1
    picture.write(
        f"reading of nest {event.nest} at pose {event.pose_label} set aside: {event.why}",
        "warn",
        event.time_s,
    )


def _frame(picture: "Picture", event: ev.FrameFound) -> None:
    picture.frame = event
    picture.write(
        f"base found in the tracker's frame from nests {', '.join(event.nests)}, "
        f"RMS {event.rms_mm * 1000:.1f} um",
        "good",
    )


def _drift(picture: "Picture", event: ev.DriftChecked) -> None:
    picture.drift = event
    fine = event.shift_mm <= event.limit_mm
    picture.write(
        f"drift {event.shift_mm * 1000:.1f} um (limit {event.limit_mm * 1000:.0f})",
        "info" if fine else "warn",
        event.time_s,
    )


def _prompt(picture: "Picture", event: ev.PromptNeeded) -> None:
    picture.prompt = replace(event, text=micro(event.text))
    picture.write(f"asked: {event.text}")


def _answered(picture: "Picture", event: ev.PromptAnswered) -> None:
    if picture.prompt is not None and picture.prompt.prompt == event.prompt:
        picture.prompt = None
    if event.answer:
        picture.write(f"answered: {event.answer}")


def _suspended(picture: "Picture", event: ev.Suspended) -> None:
    picture.run = "waiting"
    picture.say_trouble(event.why, event.remedy, "warn")


def _released(picture: "Picture", event: ev.Released) -> None:
    picture.run = "running"
    picture.trouble = None
    picture.write(f"goes on: {event.why}", "good")


def _paused(picture: "Picture", event: ev.Paused) -> None:
    picture.run = "paused"
    picture.write("paused by the operator")


def _resumed(picture: "Picture", event: ev.Resumed) -> None:
    picture.run = "running"
    picture.write("goes on")


def _stopped(picture: "Picture", event: ev.Stopped) -> None:
    picture.run = "stopped"
    picture.prompt = None
    picture.say_trouble(
        "Stopped by the operator; the machine stands still",
        f"g on the Measure screen goes on where it stopped. {event.remedy}",
        "warn",
    )


def _fault(picture: "Picture", event: ev.Fault) -> None:
    picture.run = "fault"
    picture.prompt = None
    safe = "" if event.safe else " The stop was NOT confirmed: use the emergency stop."
    picture.say_trouble(event.what + safe, f"{event.remedy} (or g on the Measure screen)")


def _finished(picture: "Picture", event: ev.Finished) -> None:
    picture.run = "finished"
    picture.run_folder = event.run_folder
    picture.trouble = None
    picture.write(f"finished: {event.readings} readings in {event.run_folder}", "good")


def _gate(picture: "Picture", event: ev.GateChecked) -> None:
    picture.gates.append(replace(event, says=micro(event.says), unit=micro(event.unit)))
    picture.write(
        f"gate {event.gate}: {'passed' if event.passed else 'REFUSED'}, {event.says}",
        "info" if event.passed else "bad",
    )


def _stage(picture: "Picture", event: ev.WriteBackStage) -> None:
    picture.stages.append(replace(event, says=micro(event.says)))
    bad = event.stage == "restore-failed"
    picture.write(f"write-back: {event.says}", "bad" if bad else "info")


FOLDS: dict[type[ev.Event], "Callable[[Picture, Any], None]"] = {
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
