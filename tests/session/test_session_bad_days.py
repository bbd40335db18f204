"""Everything that can go wrong on a measuring day, through the wires: safe, said, nothing lost."""

import asyncio
import errno
from collections.abc import Callable
from datetime import timedelta
from pathlib import Path
from typing import Any

import pytest
from session_mock import POSES, Heard, Mock, set_speed

from app.errors import GateRefused, StoppedByOperator
from app.files.pose_table import Pose
from app.files.site import parse_site
from app.ownership import Ownership
from app.session import events as ev
from app.session.journal import Journal
from app.session.plans import PlanOptions, measure_plan
from app.session.session import Session
from app.session.unwritten import unwritten
from drivers.errors import (
    DeviceError,
    DriveFault,
    HeartbeatLost,
    LinkError,
    NoTarget,
    NotReady,
    ParameterError,
    Silence,
)

TWO = {label: POSES[label] for label in "ab"}
QUICK = PlanOptions(order="pose-by-pose", warm_up=False, two_face=False)
CARRIED = PlanOptions(order="nest-by-nest", warm_up=False, two_face=False)


def begin(
    mock: Mock,
    folder: Path,
    heard: Heard,
    options: PlanOptions = QUICK,
    poses: dict[str, Pose] = TWO,
) -> Session:
    session = Session.create(
        mock.site, measure_plan(mock.site, poses, options), folder, unattended=True
    )
    session.observers.watch(heard)
    return session


async def run(session: Session) -> int:
    try:
        return (await session.run()).readings
    finally:
        await session.close()


async def resumed(session: Session, heard: Heard | None = None) -> Session:
    again = Session.reopen(session.folder, unattended=True)
    if heard is not None:
        again.observers.watch(heard)
    return again


def when(heard: Heard, session: Session, kind: str, do: Callable[[], Any]) -> None:
    """Do something once, as soon as a step of a kind begins."""
    done: list[bool] = []

    def hear(event: ev.Event) -> None:
        if isinstance(event, ev.StepStarted) and event.kind == kind and not done:
            done.append(True)
            do()

    session.observers.watch(hear)


def still(mock: Mock) -> bool:
    return not mock.hands("truth")["moving"]


@pytest.mark.long
async def test_a_beam_broken_in_the_middle_of_a_dwell_costs_no_reading(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3")
    session = begin(mock, tmp_path, heard)
    when(heard, session, "read", lambda: mock.hands("break-next-dwell", at=0.5, for_s=200.0))
    assert await run(session) == 2 * 3 + 4 + 4
    assert [event.why for event in heard.of(ev.Suspended)]
    assert len(heard.of(ev.Released)) == len(heard.of(ev.Suspended))
    kinds = [kind for _, kind, _ in _notes(session)]
    assert "reverified" in kinds  # the last good reference was read again


@pytest.mark.long
async def test_a_beam_that_stays_away_ends_unattended_and_can_be_gone_on_with(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3")
    session = begin(mock, tmp_path, heard)
    when(heard, session, "read", lambda: mock.hands("break-beam"))
    with pytest.raises(DeviceError) as lost:
        await run(session)
    assert "beam" in str(lost.value) or isinstance(lost.value, NoTarget)
    assert heard.of(ev.Fault)[0].safe
    assert "pkmcal resume" in heard.of(ev.Fault)[0].remedy
    mock.hands("restore-beam")
    assert await run(await resumed(session)) == 14


@pytest.mark.long
async def test_an_smr_in_the_wrong_hole_is_seen_and_carried_again(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "1")
    session = begin(mock, tmp_path, heard, CARRIED)
    mock.hands("fault", name="misplace:5")
    assert await run(session) == 14
    assert any("nest 3" in a.alarm.device for a in heard.of(ev.AlarmRaised))


async def test_an_smr_moved_during_the_pass_is_caught_by_the_next_reading(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "1")
    session = begin(mock, tmp_path, heard, CARRIED)
    moves: list[str] = []

    def hear(event: ev.Event) -> None:
        if isinstance(event, ev.StepStarted) and event.step.endswith("read-b-3"):
            moves.append(event.step)
            if len(moves) == 1:
                mock.hands("carry", smr=1, nest="4", follow=True)

    session.observers.watch(hear)
    assert await run(session) == 14
    rejected = heard.of(ev.ReadingRejected)
    assert "nest 4 where nest 3 was expected" in rejected[0].why
    assert all(r.miss_mm < 4.0 for r in heard.of(ev.ReadingTaken) if r.pose_label)


@pytest.mark.long
async def test_two_smrs_exchanged_do_no_harm_and_an_empty_nest_is_named(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3")
    session = begin(mock, tmp_path, heard)
    when(heard, session, "move", lambda: mock.hands("carry", smr=2, nest="birdbath"))
    with pytest.raises(DeviceError) as empty:
        await run(session)
    assert "4" in str(empty.value) or "4" in heard.of(ev.Suspended)[0].why


@pytest.mark.parametrize(
    ("fault", "says"),
    [
        ("parameter-corrupt:leg3.B_x", "leg3.B_x"),
        ("parameter-missing:leg6.L_P", "53"),
        ("parameter-nan:leg2.L0", "leg2.L0"),
    ],
)
async def test_a_controller_with_other_parameters_never_moves(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path, fault: str, says: str
) -> None:
    mock = mock_of("--smrs", "3")
    mock.hands("fault", name=fault)
    session = begin(mock, tmp_path, heard)
    with pytest.raises(ParameterError, match=says):
        await run(session)
    assert not heard.of(ev.PoseCommanded)
    assert heard.of(ev.Fault)[0].remedy


@pytest.mark.long
@pytest.mark.parametrize(
    ("fault", "error"),
    [("drive-fault:3", DriveFault), ("heartbeat-silent:4", (HeartbeatLost, Silence))],
)
async def test_a_drive_that_fails_stops_the_machine_and_the_session_goes_on_later(
    mock_of: Callable[..., Mock],
    heard: Heard,
    tmp_path: Path,
    fault: str,
    error: type[DeviceError] | tuple[type[DeviceError], ...],
) -> None:
    mock = mock_of("--smrs", "3", scale=100)
    session = begin(mock, tmp_path, heard)
    when(heard, session, "read", lambda: mock.hands("fault", name=fault))
    with pytest.raises(error):
        await run(session)
    assert still(mock)
    taken = len(heard.of(ev.ReadingTaken))
    mock.hands("clear")
    again = await resumed(session, heard)
    assert await run(again) == 14
    assert len(heard.of(ev.ReadingTaken)) == 14 >= taken


@pytest.mark.long
@pytest.mark.parametrize("which", ["tracker", "controller"])
async def test_a_tcp_reset_ends_safely_and_resumes(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path, which: str
) -> None:
    mock = mock_of("--smrs", "3", scale=100)
    session = begin(mock, tmp_path, heard)
    when(heard, session, "read", lambda: mock.hands("reset-tcp", of=which))
    with pytest.raises(LinkError):
        await run(session)
    assert heard.of(ev.Fault)
    async with asyncio.timeout(30.0):  # the machine notices that the PC is gone, and stops
        while not still(mock):  # noqa: ASYNC110 - it tells nobody
            await asyncio.sleep(0.05)
    assert await run(await resumed(session)) == 14


@pytest.mark.long
async def test_stop_works_during_a_move(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3")
    await set_speed(mock, 0.02)
    session = begin(mock, tmp_path, heard)
    job = session.start()

    def hear(event: ev.Event) -> None:
        if isinstance(event, ev.PoseCommanded) and event.pose_label == "a":
            asyncio.get_running_loop().call_soon(lambda: stops.append(stop()))

    def stop() -> "asyncio.Task[None]":
        stops_at.append(mock.hands("truth")["moving"])
        return asyncio.create_task(session.stop())

    stops: list[asyncio.Task[None]] = []
    stops_at: list[bool] = []
    session.observers.watch(hear)
    with pytest.raises(StoppedByOperator, match="pkmcal resume"):
        await job
    await session.close()
    assert stops_at == [True]
    assert still(mock)
    assert heard.of(ev.Stopped)


@pytest.mark.long
async def test_pause_holds_between_steps_and_skip_leaves_one_out(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3")
    session = begin(mock, tmp_path, heard)
    paused = asyncio.Event()
    when(heard, session, "home", lambda: (session.pause(), paused.set()))
    job = session.start()
    await asyncio.wait_for(paused.wait(), 60.0)
    begun = len(heard.of(ev.StepStarted))
    async with asyncio.timeout(60.0):
        while len(heard.of(ev.StepDone)) < begun:  # noqa: ASYNC110 - the step in work is ended
            await asyncio.sleep(0.01)
    await asyncio.sleep(0.3)
    assert len(heard.of(ev.StepStarted)) == begun
    reading: list[str] = []

    def skip_first_read(event: ev.Event) -> None:
        if isinstance(event, ev.StepStarted) and event.kind == "read":
            reading.append(event.step)
        if isinstance(event, ev.LiveScatter) and len(reading) == 1:
            reading.append("it settles: the step is in the middle of its work")
            session.skip("a bird in the beam")

    session.observers.watch(skip_first_read)
    session.resume()
    outcome = await job
    await session.close()
    assert heard.of(ev.StepSkipped)[0].why == "a bird in the beam"
    assert outcome.readings == 13


async def test_a_pose_out_of_reach_is_refused_before_anything_moves(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3")
    far = {**TWO, "far": (25.0, 25.0, 240.0, 0.26, 0.26, 0.35)}
    session = begin(mock, tmp_path, heard, poses=far)
    with pytest.raises(GateRefused, match="pose far"):
        await run(session)
    assert not heard.of(ev.PoseCommanded)


@pytest.mark.long
async def test_a_machine_in_use_is_refused_naming_the_owner(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3")
    session = begin(mock, tmp_path, heard)
    other = Ownership(session.station.owner.machine)
    other.take()
    with pytest.raises(GateRefused, match="process"):
        await run(session)
    other.release()
    assert await run(await resumed(session)) == 14


@pytest.mark.long
async def test_a_tracker_that_forgot_itself_is_initialised_again(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3")
    session = begin(mock, tmp_path, heard)
    when(heard, session, "read", lambda: mock.hands("fault", name="tracker-not-initialised"))
    assert await run(session) == 14


@pytest.mark.long
async def test_a_knocked_tracker_stand_makes_the_session_begin_anew(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3")
    session = begin(mock, tmp_path, heard)

    def knock() -> None:
        mock.hands("jump-tracker", x=0.4, y=-0.3)
        mock.hands("break-next-dwell", at=0.3, for_s=100.0)

    when(heard, session, "read", knock)
    assert await run(session) == 14
    journal = Journal(session.folder / "journal.sqlite", read_only=True)
    set_aside = [row for row in journal.rows(good_only=False) if row.status == "invalidated"]
    journal.close()
    assert len(set_aside) >= 4
    assert all("moved" in row.why for row in set_aside)


def _notes(session: Session) -> list[tuple[float, str, str]]:
    journal = Journal(session.folder / "journal.sqlite", read_only=True)
    try:
        return journal.notes()
    finally:
        journal.close()


@pytest.mark.long
async def test_a_person_is_asked_to_carry_and_told_what_was_wrong(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path
) -> None:
    """Here the person is us: each prompt is answered after the SMR was carried, once wrongly."""
    mock = mock_of("--smrs", "1")
    text = mock.site.to_toml().replace('kind = "mock"', 'kind = "operator"')
    text = "\n".join(line for line in text.splitlines() if not line.startswith("control"))
    site = parse_site(text, "site.toml", tmp_path)
    session = Session.create(site, measure_plan(site, TWO, CARRIED), tmp_path)
    session.observers.watch(heard)

    def carry(event: ev.Event) -> None:
        if isinstance(event, ev.PromptNeeded):
            wanted = event.text.split("into nest ")[-1][0]
            wrong = wanted == "4" and event.text.startswith("Put")
            mock.hands("carry", smr=1, nest="5" if wrong else wanted, follow=False)
            session.answer_prompt(event.prompt, "done")

    session.observers.watch(carry)
    assert await run(session) == 14
    asked = [event.text for event in heard.of(ev.PromptNeeded)]
    assert len(asked) == len(heard.of(ev.PromptAnswered)) == 4
    assert "no SMR is seen there" in asked[2] or "nest 5 where nest 4 was expected" in asked[2]


@pytest.mark.long
async def test_air_outside_the_band_holds_the_job_and_then_ends_it(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3", scale=2000)
    text = mock.site.to_toml() + "\n[limits]\nair_temp_C = [10.0, 12.0]\n"
    site = parse_site(text, "site.toml", tmp_path)
    session = Session.create(site, measure_plan(site, TWO, QUICK), tmp_path, unattended=True)
    session.observers.watch(heard)
    with pytest.raises(NotReady, match="the air stays at"):
        await run(session)
    assert "the site allows 10 to 12" in heard.of(ev.Suspended)[0].why
    assert not [r for r in heard.of(ev.ReadingTaken) if r.pose_label]


@pytest.mark.long
async def test_a_full_disk_is_a_sentence_and_the_session_goes_on_when_there_is_room(
    mock_of: Callable[..., Mock], tmp_path: Path, heard: Heard
) -> None:
    mock = mock_of("--smrs", "3")
    session = begin(mock, tmp_path, heard)

    def fill(event: ev.Event) -> None:
        if isinstance(event, ev.ReadingTaken) and event.pose_label == "a":
            used = session.journal._db.execute("PRAGMA page_count").fetchone()[0]
            session.journal._db.execute(f"PRAGMA max_page_count = {used}")

    session.observers.watch(fill)
    with pytest.raises(DeviceError, match="disk is full") as full:
        await run(session)
    assert str(session.folder) in full.value.remedy
    assert heard.of(ev.Fault)[-1].safe
    assert not mock.hands("truth")["moving"]
    assert await run(await resumed(session)) == 14


async def test_a_folder_that_becomes_read_only_is_a_sentence_and_the_session_goes_on_later(
    mock_of: Callable[..., Mock], tmp_path: Path, heard: Heard
) -> None:
    mock = mock_of("--smrs", "3")
    session = begin(mock, tmp_path, heard)

    def forbid(event: ev.Event) -> None:
        if isinstance(event, ev.ReadingTaken) and event.pose_label == "a":
            session.journal._db.execute("PRAGMA query_only = 1")  # SQLITE_READONLY from now on

    session.observers.watch(forbid)
    with pytest.raises(DeviceError, match="readonly") as forbidden:
        await run(session)
    assert "Let this user write there, then: pkmcal resume" in forbidden.value.remedy
    assert not mock.hands("truth")["moving"]
    assert await run(await resumed(session)) == 14


def test_what_may_not_be_written_is_told_from_what_has_no_room(tmp_path: Path) -> None:
    full = unwritten(OSError(errno.ENOSPC, "No space left on device"), tmp_path)
    forbidden = unwritten(PermissionError(errno.EROFS, "Read-only file system"), tmp_path)
    assert full.remedy.startswith("Make room on it, then")
    assert forbidden.remedy.startswith("Let this user write there, then")


async def test_a_clock_that_is_set_back_in_the_middle_changes_no_time_of_a_run(
    mock_of: Callable[..., Mock], tmp_path: Path, heard: Heard
) -> None:
    mock = mock_of("--smrs", "3")
    session = begin(mock, tmp_path, heard)
    told = session.station.clock._utc

    def set_back(event: ev.Event) -> None:
        if isinstance(event, ev.ReadingTaken) and event.pose_label == "a":
            session.station.clock._utc = lambda: told() - timedelta(hours=3.0)

    session.observers.watch(set_back)
    assert await run(session) == 14
    journal = Journal(session.folder / "journal.sqlite", read_only=True)
    times = [row.time_s for row in journal.rows()]
    utc = [entry[0] for entry in journal.log()]
    journal.close()
    assert times == sorted(times)
    assert utc != sorted(utc)
