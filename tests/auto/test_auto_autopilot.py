"""The loop on a simulated laboratory: what is journaled, and that it goes on where it was."""

import asyncio
import json
from collections.abc import Callable, Mapping
from dataclasses import asdict
from math import exp
from pathlib import Path

import pytest

from app.auto.autopilot import Autopilot, Seen
from app.auto.decision import Decision, Limits
from app.auto.journal import NAME, Decisions
from app.auto.known import known_by
from app.auto.report import report_of
from app.auto.wording import open_words
from app.errors import GateRefused, StoppedByOperator
from app.files.pose_table import Pose, poses_text
from app.jobs.posing import choose_poses
from app.jobs.simulating import simulate
from calib.errors import BadInput
from drivers.errors import DeviceError
from tests.answers import faults_of

HIDDEN = {"backlash.leg3": 0.03}


class Simulated:
    """Runs of the mock's physics; what is written is only remembered."""

    def __init__(self, folder: Path, *, lost_at: int = -1, lost_warm: int = -1) -> None:
        self.folder, self.lost_at, self.lost_warm = folder, lost_at, lost_warm
        self.warmed: list[tuple[float, str | None]] = []
        self.asked: list[tuple[str, str | None]] = []
        self.written: list[Path] = []

    async def choose(self, count: int, seed: int) -> Mapping[str, Pose]:
        return choose_poses("hexapod", count, candidates=200, seed=seed).by_label()

    async def measure(
        self, poses: Mapping[str, Pose], title: str, began: Callable[[str], None], again: str | None
    ) -> tuple[str, float]:
        run = again or str(self.folder / f"run-{len(self.asked)}")
        self.asked.append((run, again))
        if again is None:
            began(run)
        if len(self.asked) - 1 == self.lost_at:
            raise DeviceError("tracker: no answer")
        table = self.folder / f"poses-{len(self.asked)}.csv"
        table.write_text(poses_text(poses), encoding="utf-8")
        simulate("hexapod", run, seed=3, poses=table, effects=HIDDEN)
        return run, 2.0 * len(poses)

    async def warm_up(
        self, minutes: float, began: Callable[[str], None], again: str | None
    ) -> float:
        self.warmed.append((minutes, again))
        if again is None:
            began(str(self.folder / "warming"))
        if len(self.warmed) - 1 == self.lost_warm:
            raise DeviceError("controller: no answer")
        return minutes

    async def apply(self, model: Path) -> Mapping[str, str]:
        self.written.append(model)
        return {}

    async def verify(self, began: Callable[[str], None], again: str | None) -> Seen:
        return Seen(3.0, 5.0, 40.0)


class Operator:
    """Gives the answers one after the other, and then always the last one."""

    def __init__(self, *answers: str) -> None:
        self.answers, self.asked = list(answers), list[str]()

    async def __call__(self, text: str, answers: tuple[str, ...], typed: str) -> str:
        assert answers[:2] == ("go on", "skip")
        assert answers[-1] == "stop"
        assert bool(typed) == text.startswith(("measure", "let it warm up"))
        self.asked.append(text)
        return self.answers.pop(0) if len(self.answers) > 1 else self.answers[0]


def fly(folder: Path, laboratory: Simulated, **more: object) -> tuple[Autopilot, Decision]:
    pilot = Autopilot(folder, laboratory, Limits(8.0, first=12), **more)  # type: ignore[arg-type]
    return pilot, asyncio.run(pilot.run())


CREEP = {"effect": "leg-warm-up", "left_um": 40.0, "tau_min": 15.0}


def measured(folder: Path, creep: Mapping[str, object] | None = None, **more: object) -> None:
    """A journal in which a first set was measured, and found good enough."""
    journal = Decisions(folder)
    journal.write("begun", seed=1, limits={"target_um": 8.0, "first": 12, "apply": True})
    first = Decision("measure", "nothing was measured yet", 12, ground="first")
    journal.write("decided", number=1, **asdict(first))
    journal.write("done", number=1, run="one", poses=12, minutes=24.0)
    journal.write(
        "found", runs=["one"], model="model-01.toml", effects=["leg-warm-up"], ambiguous=[],
        unexplained=False, predicted_um=3.0, conditions={}, creep=creep, **more,
    )  # fmt: skip


def test_the_whole_way_and_its_journal(tmp_path: Path) -> None:
    laboratory = Simulated(tmp_path)
    pilot, last = fly(tmp_path, laboratory)
    report = report_of(pilot, last, tmp_path)
    assert faults_of(report.to_json()) == []
    assert report.reached is True
    assert report.effects == ("backlash",)
    assert [d.kind for d in report.decisions][-3:] == ["apply", "verify", "stop"]
    assert [Path(str(report.model))] == laboratory.written
    events = [json.loads(line)["event"] for line in (tmp_path / NAME).read_text().splitlines()]
    assert events.index("decided") < events.index("session") < events.index("done")
    again, last_again = fly(tmp_path, laboratory)  # nothing is done twice
    assert last_again == last
    assert len(laboratory.written) == 1
    assert len(again.journal.lines) == len(pilot.journal.lines) + 2


class Good(Simulated):
    """Its machine was calibrated before."""

    async def apply(self, model: Path) -> Mapping[str, str]:
        raise GateRefused("gain: 1.1 (at most 1)", gates=("gain",))


def test_a_machine_that_is_good_already_is_left_so_and_proven(tmp_path: Path) -> None:
    measured(tmp_path)
    pilot, last = fly(tmp_path, Good(tmp_path))
    kinds = [line["kind"] for line in pilot.journal.of("decided")]
    assert kinds[-3:] == ["apply", "verify", "stop"]
    assert last.reached
    assert "left as it is" in next(
        line["says"] for line in pilot.journal.of("done") if "left_out" in line
    )


def test_a_fault_is_raised_and_the_same_session_is_gone_on_with(tmp_path: Path) -> None:
    with pytest.raises(DeviceError):
        fly(tmp_path, Simulated(tmp_path, lost_at=0))
    with (tmp_path / NAME).open("ab") as file:
        file.write(b'{"event": "do')  # killed while it wrote
    laboratory = Simulated(tmp_path)
    operator = Operator("skip")
    _, last = fly(tmp_path, laboratory, ask=operator)
    assert laboratory.asked[0] == (str(tmp_path / "run-0"), str(tmp_path / "run-0"))
    assert [text.split(":")[0] for text in operator.asked] == ["write the correction"]
    assert (last.kind, last.reached) == ("stop", False)
    assert "the operator said no" in last.why
    assert laboratory.written == []


@pytest.mark.long
def test_a_person_chooses_how_many_poses_stops_and_comes_back(tmp_path: Path) -> None:
    laboratory = Simulated(tmp_path)
    operator = Operator("14 poses", "stop")
    with pytest.raises(StoppedByOperator, match=str(tmp_path)):
        fly(tmp_path, laboratory, ask=operator)
    said = [line["says"] for line in Decisions(tmp_path).of("done")]
    assert said[0] == "the operator chose: measure 14 poses"
    assert said[1].startswith("14 poses in")
    assert laboratory.written == []
    # What was asked last is asked again; then the machine is measured once more instead.
    operator = Operator("measure 7 poses instead", "go on", "go on")
    pilot, last = fly(tmp_path, laboratory, ask=operator)
    assert (last.kind, last.reached) == ("stop", True)
    report = report_of(pilot, last, tmp_path)
    assert faults_of(report.to_json()) == []
    assert [(d.kind, d.count) for d in report.decisions] == [
        ("measure", 12), ("measure", 14), ("apply", 0), ("measure", 7), ("apply", 0), ("verify", 0),
        ("stop", 0),
    ]  # fmt: skip
    assert report.poses == 21


def test_an_answer_that_is_none_is_refused_and_the_decision_stays(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="no answer"):
        fly(tmp_path, Simulated(tmp_path), ask=Operator("perhaps"))
    assert Decisions(tmp_path).open is not None


def test_journals_of_before_grounds_were_kept_end_as_they_ended(tmp_path: Path) -> None:
    lines = [
        {"event": "begun", "seed": 1, "limits": {"target_um": 8.0, "first": 12, "apply": True}},
        {"event": "decided", "number": 1, "kind": "measure", "why": "nothing was measured yet",
         "count": 12, "pair": None, "expected": {}, "reached": None},
        {"event": "done", "number": 1, "vetoed": True, "says": "not done: the operator said no"},
    ]  # fmt: skip
    (tmp_path / NAME).write_text("".join(json.dumps(line) + "\n" for line in lines))
    _, last = fly(tmp_path, Simulated(tmp_path))
    assert (last.kind, last.why) == ("stop", "the operator said no")


def test_a_prediction_is_carried_on_as_it_fell_with_the_same_effects(tmp_path: Path) -> None:
    def falls(effects: list[str], um: float) -> float | None:
        journal = Decisions(tmp_path)
        found = {"model": "m", "ambiguous": [], "unexplained": False, "conditions": {}}
        journal.write("done", number=1, run="one", poses=15, minutes=30.0)
        journal.write("found", runs=["one"], effects=["screw-pitch"], predicted_um=80.0, **found)
        journal.write("done", number=2, run="two", poses=45, minutes=90.0)
        journal.write("found", runs=["one", "two"], effects=effects, predicted_um=um, **found)
        told = known_by(journal).falls
        journal.path.unlink()
        return told

    assert falls(["screw-pitch"], 20.0) == pytest.approx(1.0)
    assert falls(["screw-pitch"], 70.0) == 0.5
    assert falls(["screw-pitch"], 0.1) == 2.0
    assert falls(["backlash"], 20.0) is None


def test_a_damaged_journal_is_named(tmp_path: Path) -> None:
    (tmp_path / NAME).write_text('{"event": "begun"}\nnot json\n{"event": "done"}\n')
    with pytest.raises(BadInput, match=r"decisions\.jsonl:2"):
        Decisions(tmp_path)


def kinds_of(folder: Path) -> list[str]:
    return [line["kind"] for line in Decisions(folder).of("decided")]


def test_a_machine_that_creeps_is_let_warm_up_before_it_is_written_and_proven(
    tmp_path: Path,
) -> None:
    measured(tmp_path, CREEP)
    with pytest.raises(DeviceError):
        fly(tmp_path, Simulated(tmp_path, lost_warm=0))
    laboratory = Simulated(tmp_path)
    pilot, last = fly(tmp_path, laboratory)
    assert laboratory.warmed == [
        (45.0, str(tmp_path / "warming"))
    ]  # the same session, gone on with
    assert kinds_of(tmp_path) == ["measure", "warm-up", "apply", "verify", "stop"]
    report = report_of(pilot, last, tmp_path)
    assert faults_of(report.to_json()) == []
    assert (report.reached, report.minutes, report.poses) == (True, 24.0 + 45.0 + 40.0, 12)
    wait = report.decisions[1]
    assert wait.minutes == 45.0
    assert wait.expected == pytest.approx({"creeps_um": 40.0, "creeps_um_then": 40.0 * exp(-3.0)})
    assert wait.came == "kept moving for 45 min"


def test_what_was_not_asked_and_not_written_is_said_at_the_end(tmp_path: Path) -> None:
    class Poor(Simulated):
        async def apply(self, model: Path) -> Mapping[str, str]:
            return {"thermal-growth": "the controller has no compensation for it"}

    unknown = "run.toml has no [load]"
    measured(tmp_path, not_asked=dict.fromkeys(("gravity-sag", "base-bending"), unknown))
    pilot, last = fly(tmp_path, Poor(tmp_path))
    report = report_of(pilot, last, tmp_path)
    assert faults_of(report.to_json()) == []
    assert open_words(report) == [
        "not asked: gravity-sag, base-bending (run.toml has no [load])",
        "not written: thermal-growth (the controller has no compensation for it)",
    ]


def test_a_person_says_how_long_it_warms_up_or_that_it_does_not(tmp_path: Path) -> None:
    for said, warmed, kinds in (
        (("20 min", "skip", "go on"), [(20.0, None)], ["warm-up", "warm-up", "warm-up"]),
        (("skip", "go on"), [], ["warm-up"]),
    ):
        folder = tmp_path / said[0]
        folder.mkdir()
        measured(folder, CREEP)
        laboratory, operator = Simulated(folder), Operator(*said)
        _, last = fly(folder, laboratory, ask=operator)
        assert laboratory.warmed == warmed
        assert kinds_of(folder) == ["measure", *kinds, "apply", "verify", "stop"]
        assert last.reached
        assert "the platform is about 40 um from where it will be, 2.0 um then" in operator.asked[0]


def test_journals_of_before_machines_were_let_warm_up_are_gone_on_with(tmp_path: Path) -> None:
    measured(tmp_path, CREEP)
    path = tmp_path / NAME
    lines = [json.loads(line) for line in path.read_text().splitlines()]
    for line in lines:
        line.pop("minutes", None) if line["event"] == "decided" else line.pop("creep", None)
    path.write_text("".join(json.dumps(line) + "\n" for line in lines))
    _, last = fly(tmp_path, Simulated(tmp_path))
    assert last.reached
    assert kinds_of(tmp_path) == ["measure", "apply", "verify", "stop"]
