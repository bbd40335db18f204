"""A station for scripts, on a mock: measured, stopped and gone on with, written back and undone."""

import asyncio
import json
import re
import signal
import threading
import time
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import tomli_w

import pkmcal
from app.cli import run
from app.session import events as ev
from mocks.control import ControlClient
from tests.answers import faults_of

SCALE = 1500.0


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Path]:
    with pkmcal.mock_station(seed=4, scale=SCALE, folder=tmp_path / "mock") as site:
        yield site


def grid(count: int) -> dict[str, tuple[float, float, float, float, float, float]]:
    """Some poses of the verification grid."""
    poses = pkmcal.verification_grid("hexapod").by_label()
    return {label: poses[label] for label in list(poses)[:: len(poses) // count][:count]}


def changed(site: Path, **hands: Any) -> Path:
    """The same site with other hands."""
    data = tomllib.loads(site.read_text("utf-8"))
    data["hands"] = hands
    other = site.with_name("other-site.toml")
    other.write_text(tomli_w.dumps(data), "utf-8")
    return other


@pytest.mark.long
@pytest.mark.timeout(240)
def test_the_whole_job_without_a_person(
    site: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    model, sessions = tmp_path / "model.toml", tmp_path / "sessions"
    with pkmcal.Station(site, folder=sessions) as station:
        poses = pkmcal.choose_poses(site=site, n=12, candidates=40)
        measured = station.measure(poses.by_label(), warm_up=False)
        assert measured.readings == pkmcal.fit(measured.run).readings
        pkmcal.fit(measured.run).save(model)
        before = station.verify(grid(3))

        with pytest.raises(pkmcal.BadInput, match="nobody is there to confirm"):
            station.apply(model)
        asked = station.propose(model)
        assert not asked.written
        assert station.sets().sets == ()

        done = station.apply(model, yes=True)
        assert done.written
        assert [(c.name, c.new) for c in done.changes] == [(c.name, c.new) for c in asked.changes]
        after = station.verify(grid(3), before=before)
        assert after.before is not None
        assert after.before.measured == before.measured
        assert after.measured.position_peak_um < 0.2 * before.measured.position_peak_um

        assert done.snapshot is not None
        assert [s.number for s in station.sets().sets] == [done.snapshot, done.kept]
        assert station.undo().restored == done.snapshot
        assert station.sets().present(done.snapshot)

    # The verbs go on where the script was: the same state of the controller, the same answers.
    capsys.readouterr()
    assert run(["undo", "--site", str(site), "--list", "--json"]) == 0
    listed = json.loads(capsys.readouterr().out)
    with pkmcal.Station(site, folder=sessions) as station:
        assert station.sets().to_json() == listed


@pytest.mark.long
@pytest.mark.timeout(120)
def test_script_and_verb_verify_alike(
    site: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    from app.jobs.verifying import verification_report

    table = tmp_path / "poses.csv"
    table.write_text(
        "pose,x,y,z,rx,ry,rz\n"
        + "".join(f"{label},{','.join(map(str, pose))}\n" for label, pose in grid(2).items()),
        "utf-8",
    )
    words = ["--site", str(site), "--poses", str(table), "--folder", str(tmp_path / "theirs")]
    capsys.readouterr()
    assert run(["verify", *words, "--truth", "--unattended", "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert verification_report(said["session"]).to_json() == said
    with pkmcal.Station(site, folder=tmp_path / "ours") as station:
        ours = station.verify(table, truth=True)
    assert verification_report(ours.session).to_json() == ours.to_json()
    assert ours.truth is not None
    assert ours.truth.position_peak_um == pytest.approx(said["truth"]["position_peak_um"], rel=0.05)


@pytest.mark.long
@pytest.mark.timeout(120)
@pytest.mark.parametrize("how", ["stop", "interrupt"])
def test_a_job_that_was_stopped_is_gone_on_with(how: str, site: Path, tmp_path: Path) -> None:
    reading, asked, heard = threading.Event(), threading.Event(), []

    def watch(event: ev.Event) -> None:
        heard.append(event)
        if isinstance(event, ev.ReadingTaken) and event.pose_label:
            reading.set()
            asked.wait(60.0)  # the job must not end before it is asked to stop

    with pkmcal.Station(site, folder=tmp_path / "sessions", watch=watch) as station:

        def stop() -> None:
            reading.wait(60.0)
            if how == "stop":
                asked.set()  # a stop is heard where the job runs, which must not wait for us
                station.stop()
            else:
                signal.raise_signal(signal.SIGINT)
                time.sleep(1.0)  # the call that waits looks up a few times a second
                asked.set()

        stopping = threading.Thread(target=stop)
        stopping.start()
        with pytest.raises(pkmcal.StoppedByOperator, match="pkmcal resume"):
            station.measure(grid(4), warm_up=False)
        stopping.join()
        done = station.resume()
    assert any(isinstance(event, ev.Finished) for event in heard)
    taken = [e for e in heard if isinstance(e, ev.ReadingTaken) and e.pose_label]
    assert len({(e.pose_label, e.nest) for e in taken}) == 12
    assert done.readings == len(pkmcal.load_runs(done.run).line)


@pytest.mark.long
@pytest.mark.timeout(120)
def test_an_operator_function_carries_what_the_job_asks_for(site: Path, tmp_path: Path) -> None:
    hands = tomllib.loads(site.read_text("utf-8"))["hands"]
    asked: list[str] = []

    def operator(text: str, answers: tuple[str, ...]) -> str:
        asked.append(text)
        nest = text.split("into nest ")[1].split(",")[0]
        smr = int(text.split("SMR ")[1].split(" ")[0]) if "SMR 1" in text or "SMR 2" in text else 3
        with ControlClient(hands["control"]) as client:
            client("carry", smr=smr, nest=nest)
        assert "done" in answers
        return "done"

    people = changed(site, kind="operator", smrs=3)
    with pkmcal.Station(people, folder=tmp_path / "sessions", operator=operator) as station:
        done = station.measure(grid(2), warm_up=False)
    assert len(asked) == 3
    assert done.readings > 6


@pytest.mark.long
@pytest.mark.timeout(120)
def test_a_person_who_is_missed_is_said(site: Path, tmp_path: Path) -> None:
    people = changed(site, kind="operator", smrs=3)
    with (
        pkmcal.Station(people, folder=tmp_path / "sessions") as station,
        pytest.raises(pkmcal.DeviceError, match="a person is needed"),
    ):
        station.measure(grid(2), warm_up=False)


@pytest.mark.timeout(120)
def test_a_fault_in_the_operator_function_stops_the_machine_and_is_raised(
    site: Path, tmp_path: Path
) -> None:
    def operator(text: str, answers: tuple[str, ...]) -> str:
        raise LookupError("the robot has lost its gripper")

    people = changed(site, kind="operator", smrs=3)
    with (
        pkmcal.Station(people, folder=tmp_path / "sessions", operator=operator) as station,
        pytest.raises(LookupError, match="gripper"),
    ):
        station.measure(grid(2), warm_up=False)


@pytest.mark.long
@pytest.mark.timeout(120)
def test_asynchronous_scripts_wait_for_other_things_meanwhile(site: Path, tmp_path: Path) -> None:
    async def work() -> tuple[int, int]:
        ticks = 0
        async with pkmcal.AsyncStation(site, folder=tmp_path / "sessions") as station:
            job = asyncio.create_task(station.measure(grid(2), warm_up=False))
            while not job.done():
                await asyncio.sleep(0.05)
                ticks += 1
                if ticks == 3:
                    with pytest.raises(pkmcal.GateRefused, match="another job"):
                        await station.sets()
            return ticks, (await job).readings

    ticks, readings = asyncio.run(work())
    assert ticks > 3
    assert readings > 6


def test_a_machine_has_one_owner_and_is_let_go(site: Path, tmp_path: Path) -> None:
    with pkmcal.Station(site, folder=tmp_path), pytest.raises(pkmcal.GateRefused):
        pkmcal.Station(site, folder=tmp_path).__enter__()
    with pkmcal.Station(site, folder=tmp_path) as station:
        station.connect()
    began = time.monotonic()
    station.close()
    assert time.monotonic() - began < 1.0


@pytest.mark.long
@pytest.mark.timeout(180)
def test_a_script_decides_with_the_autopilot_stops_it_and_goes_on(
    site: Path, tmp_path: Path
) -> None:
    asked: list[str] = []

    def decide(text: str, answers: tuple[str, ...]) -> str:
        asked.append(text)
        assert answers[:2] == ("go on", "skip")
        if text.startswith("measure"):
            return "7 poses"
        return "skip" if text.startswith("tell") else "stop"

    told: list[str] = []
    folder = tmp_path / "auto"
    with pkmcal.Station(site, folder=tmp_path / "sessions") as station:
        with pytest.raises(pkmcal.BadInput, match="no target"):
            station.auto(out=folder)
        with pytest.raises(pkmcal.StoppedByOperator, match=re.escape(str(folder))):
            station.auto(1000.0, apply=True, out=folder, decide=decide, tell=told.append)
        assert [text.split(":")[0] for text in asked][-1] == "write the correction"
        found = station.auto(out=folder, tell=told.append)
    assert faults_of(found.to_json()) == []
    assert found.reached is True
    assert found.target_um == 1000.0
    assert found.poses == 7
    assert [one.kind for one in found.decisions][-3:] == ["apply", "verify", "stop"]
    assert told[0].startswith("1. measure 15 poses: nothing was measured yet")
    sessions = pkmcal.list_sessions(folder / "sessions").sessions
    assert [one.purpose for one in sessions].count("measure") == 1
    log = pkmcal.session_log(folder=folder / "sessions")
    assert log.session.folder == sessions[0].folder
    assert log.entries
    events = pkmcal.history_of(folder / "sessions").machines[0].events
    assert "applied" in [event.kind for event in events]
