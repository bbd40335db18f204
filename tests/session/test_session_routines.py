"""What single routines promise, each in a lab without wires."""

import asyncio
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from session_lab import Lab, lab_in, lab_site
from session_mock import POSES, Heard

from app.files.machines import load_machine
from app.session import events as ev
from app.session import kinds
from app.session.path import waypoints
from app.session.plan import Plan, PlanWriter, Step
from app.session.plans import warming_plan
from app.session.routines.beam import aim, measured
from app.session.routines.carrying import ensure_smr, misplaced
from app.session.routines.moving import commanded_coordinates, ensure_at, take_stock
from app.session.routines.preparing import warm_up
from app.session.routines.reading import in_band, read
from app.session.routines.referencing import drift, reference
from app.session.rows import NewRow
from app.session.session import Session
from app.session.station import Station
from calib.errors import BadInput
from calib.frames import Frame
from drivers.errors import HeartbeatLost, LinkLost, NoTarget, NotReady

STEP = Step("0001-warm-up", kinds.WARM_UP, "")


@pytest.fixture
def lab(tmp_path: Path, heard: Heard) -> Lab:
    made = lab_in(tmp_path)
    made.session.observers.watch(heard)
    return made


def step(kind: kinds.StepKind, **arguments: object) -> Step:
    return Step(f"0001-{kind.name}", kind, "", arguments)


async def referenced(lab: Lab, attempt: int) -> ev.Event:
    """Read every base nest and judge the drift; returns what that told last."""
    work, nests = lab.session.work, list(lab.room.site.base_nests)
    for nest in nests:
        done = await reference(work, step(kinds.REFERENCE, nest=nest))
        assert done.reading is not None
        row = NewRow(**{**vars(done.reading)})
        work.journal.add_row(f"reference-{nest}-{attempt}", 1, "now", row)
    return (await drift(work, step(kinds.DRIFT, nests=nests))).news[-1]


# where things are


def test_nests_on_the_base_are_where_they_are_whatever_the_pose(lab: Lab) -> None:
    work, site = lab.session.work, lab.room.site
    base = [work.predict("b1", label) for label in ("a", "b", "home")]
    np.testing.assert_array_equal(base[0], Frame.of(site.tracker.frame).apply(np.array(
        site.base_nests["b1"])))  # fmt: skip
    assert all(np.array_equal(one, base[0]) for one in base)
    assert np.linalg.norm(work.predict("3", "a") - work.predict("3", "b")) > 1.0


@pytest.mark.parametrize("seen_at", ["3", "4", "5", "b1", "b4"])
def test_an_smr_is_right_in_its_own_nest_alone(lab: Lab, seen_at: str) -> None:
    work = lab.session.work
    says = misplaced(work, "3", "a", work.predict(seen_at, "a"))
    assert says == (
        "" if seen_at == "3" else f"the tracker sees nest {seen_at} where nest 3 was expected"
    )


@pytest.mark.parametrize("frame_found", [True, False])
def test_an_smr_in_no_nest_is_told_by_its_distance(lab: Lab, frame_found: bool) -> None:
    """Before the base is found it may be as far away as the site file says the frame may be."""
    work = lab.session.work
    work.memory.frame_found = frame_found
    allowed = work.limits.hole_radius_mm
    allowed += 0.0 if frame_found else work.site.tracker.frame_radius_mm
    for beyond in (-0.01, 0.01):
        off = np.array([0.0, 0.0, allowed + beyond])
        says = misplaced(work, "b1", "a", work.predict("b1", "a") + off)
        said = f"the SMR is {allowed + beyond:.2f} mm from nest b1 and in no other nest"
        assert says == (said if beyond > 0.0 else "")


@pytest.mark.parametrize(("part", "beside", "says"), [
    (0.15, 0.0, "stands in the line of sight to nest b1"), (0.15, 40.0, "in no other nest"),
    (0.965, 0.0, "in no other nest"), (1.3, 0.0, "in no other nest"),
])  # fmt: skip
def test_an_smr_before_a_nest_is_told_from_one_beside_it(
    lab: Lab, part: float, beside: float, says: str
) -> None:
    work = lab.session.work
    sight = work.predict("b1", "a")
    across = np.cross([0.0, 0.0, 1.0], sight)
    seen = part * sight + beside * across / np.linalg.norm(across)
    assert says in misplaced(work, "b1", "a", seen)


async def test_a_hidden_base_nest_is_told_with_what_hides_it(
    lab: Lab, monkeypatch: pytest.MonkeyPatch
) -> None:
    work, before = lab.session.work, lab.room.sees("b1")
    await ensure_at(work, "home")
    await aim(work, "b1")
    work.memory.settled = True
    monkeypatch.setattr(lab.room, "sees", lambda _: 0.15 * before)
    with pytest.raises(NotReady, match="in the line of sight to nest b1") as raised:
        await reference(work, step(kinds.REFERENCE, nest="b1"))
    assert "birdbath" in str(raised.value.remedy)


@pytest.mark.parametrize(("base_smrs", "nest", "asks"), [
    (True, "b1", False), (False, "b1", True), (True, "3", False), (False, "3", False),
])  # fmt: skip
async def test_nobody_carries_an_smr_to_where_one_is(
    tmp_path: Path, base_smrs: bool, nest: str, asks: bool
) -> None:
    """Unattended, whoever would have to carry one is missed."""
    work = lab_in(tmp_path, hands={"base_smrs": base_smrs}).session.work
    if asks:
        with pytest.raises(NoTarget, match="Put SMR 1 into nest b1"):
            await ensure_smr(work, nest)
    else:
        await ensure_smr(work, nest)


@pytest.mark.parametrize(("machine", "count"), [
    ("hexapod", 6), ("stewart", 6), ("delta", 3), ("tripod", 3), ("ptm", 2), ("arm", 6),
])  # fmt: skip
def test_a_controller_is_sent_as_many_coordinates_as_its_machine_has_freedoms(
    machine: str, count: int
) -> None:
    known = load_machine(machine)
    sent = commanded_coordinates(known, known.home)
    assert len(sent) == count
    if count == 6:
        assert sent == known.home


# the base


async def test_the_base_is_found_once_and_judged_ever_after(lab: Lab, heard: Heard) -> None:
    work, along_x = lab.session.work, np.array([1.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    stands = np.array(lab.room.frame.numbers()) + 0.5 * along_x
    lab.room.frame = Frame.of(tuple(stands))
    found = await referenced(lab, 1)
    assert isinstance(found, ev.FrameFound)
    np.testing.assert_allclose(work.memory.frame.numbers(), stands, atol=1e-9)
    limit = work.limits.drift_mm
    for attempt, part in enumerate((0.0, 0.98, 1.02), start=2):
        lab.room.frame = Frame.of(tuple(stands + part * limit * along_x))
        told = await referenced(lab, attempt)
        assert isinstance(told, ev.DriftChecked)
        assert told.shift_mm == pytest.approx(part * limit, abs=1e-9)
        np.testing.assert_allclose(work.memory.frame.numbers(), lab.room.frame.numbers(), atol=1e-9)
    assert [event.alarm.what for event in heard.of(ev.AlarmRaised)] == [
        "the base moved 51 um since the first reference (limit 50)"
    ]


# the beam, and the air


async def test_a_tracker_that_is_not_ready_is_pointed_anew_and_not_initialised(
    lab: Lab, heard: Heard
) -> None:
    work, tracker = lab.session.work, lab.tracker
    work.memory.settled = True
    tracker.fails = [NotReady("the laser is not stable", device="tracker")]
    begun = time.monotonic()
    await measured(work, "b1", 1.0)
    assert time.monotonic() - begun > 0.9  # not asked again at once
    assert lab.room.log == ["point", "point", "measure b1"]
    assert len(heard.of(ev.Suspended)) == len(heard.of(ev.Released)) == 1


async def test_a_tracker_that_forgot_is_initialised_and_told_its_reflector(lab: Lab) -> None:
    work, tracker = lab.session.work, lab.tracker
    work.memory.settled = True
    work.station.site = replace(
        work.site, tracker_there=replace(work.site.tracker, reflector="RRR 1.5in")
    )
    tracker.fails = [NotReady("not initialised", device="tracker")]
    tracker.initialized = False
    await measured(work, "b1", 1.0)
    assert lab.room.log == ["point", "initialize", "reflector RRR 1.5in", "point", "measure b1"]


async def test_air_that_comes_back_is_waited_for_until_it_is_well_inside(
    lab: Lab, heard: Heard
) -> None:
    work = lab.session.work
    low, high = work.limits.air_temp_C
    looks = iter([high + 1.0, high - 0.1, low - 1.0, low + 0.4, low + 0.6, 20.0])
    lab.room.air_temp_C = lambda: next(looks)
    assert (await in_band(work))["air_temp_C"] == low + 0.6
    assert len(heard.of(ev.Suspended)) == len(heard.of(ev.Released)) == 1
    assert not work.memory.verified


@pytest.mark.parametrize("part", [0.0, 1.0])
async def test_air_at_the_very_end_of_its_band_holds_nothing_up(
    lab: Lab, heard: Heard, part: float
) -> None:
    low, high = lab.session.work.limits.air_temp_C
    lab.room.air_temp_C = lambda: low + part * (high - low)
    await in_band(lab.session.work)
    assert not heard.of(ev.Suspended)
    assert lab.session.work.memory.verified


async def test_after_the_air_came_back_a_reference_is_read_before_the_reading(lab: Lab) -> None:
    work = lab.session.work
    await referenced(lab, 1)
    await ensure_at(work, "a")
    work.memory.settled = True
    temperatures = iter([40.0, 20.0])
    lab.room.air_temp_C = lambda: next(temperatures, 20.0)
    work.memory.channels = (0.0, {})
    lab.room.log.clear()
    done = await read(work, step(kinds.READ, pose="a", nest="3"))
    measured_at = [line.split()[1] for line in lab.room.log if line.startswith("measure")]
    assert measured_at == ["3", "b1", "3"]
    assert done.reading is not None
    assert work.memory.verified


@pytest.mark.parametrize("cold", [0, 2])
async def test_a_laser_that_is_warm_releases_nothing(lab: Lab, heard: Heard, cold: int) -> None:
    lab.tracker.warm_after = cold
    await warm_up(lab.session.work, STEP)
    said = [len(heard.of(kind)) for kind in (ev.Suspended, ev.Released)]
    assert said == ([1, 1] if cold else [0, 0])


# where the machine stands


async def test_a_machine_that_stands_where_it_was_last_sent_need_not_be_sent_again(
    lab: Lab,
) -> None:
    work = lab.session.work
    await ensure_at(work, "a")
    await take_stock(work)
    assert work.memory.standing_at == "a"
    assert work.memory.q == lab.controller.q
    assert len(work.journal.rows()) == 1


@pytest.mark.parametrize(
    ("about", "rows"), [("moving", 1), ("off", 1), ("sent elsewhere", 2), ("unknown", 1)]
)
async def test_in_any_doubt_the_machine_is_sent_again(lab: Lab, about: str, rows: int) -> None:
    """A row is added only where the journal says otherwise than the controller."""
    work, controller = lab.session.work, lab.controller
    if about != "unknown":
        await ensure_at(work, "a")
    controller.moving = about == "moving"
    controller.enabled = about != "off"
    if about == "sent elsewhere":
        controller.q = (*controller.q[:5], controller.q[5] + 1e-3)
    await take_stock(work)
    assert work.memory.standing_at is None
    assert work.memory.q == controller.q
    assert len(work.journal.rows()) == rows
    assert work.journal.rows()[-1].q == controller.q


# the station


async def test_a_station_that_is_not_connected_is_stopped_already(lab: Lab) -> None:
    assert await Station(lab.room.site).safe_stop() is True


@pytest.mark.parametrize("who", ["", "controller", "tracker"])
async def test_a_stop_is_confirmed_by_both_devices_or_told_not_to_be(
    lab: Lab, heard: Heard, who: str
) -> None:
    if who:
        getattr(lab, who).stop_fails = LinkLost("the link is gone", device=who)
    assert await lab.session.station.safe_stop() is (not who)
    assert sorted(lab.room.log) == ["stop LabController", "stop LabTracker"]
    alarms = [event.alarm for event in heard.of(ev.AlarmRaised)]
    assert [alarm.fault for alarm in alarms] == [True] * bool(who)


async def test_a_fault_that_stands_ends_a_step_that_waits_for_a_person(
    tmp_path: Path, heard: Heard
) -> None:
    """Nothing is said on the wire while somebody carries an SMR: it is the watch that looks."""
    writer = PlanWriter()
    writer.add(kinds.CONNECT)
    writer.add(kinds.CARRY, nest="3", smr=1)
    lab = lab_in(tmp_path, plan=Plan("measure", "", "hexapod", {}, tuple(writer.steps)))
    lab.session.work.unattended = False
    lab.session.observers.watch(heard)

    def trip(event: ev.Event) -> None:
        if isinstance(event, ev.PromptNeeded):
            lab.room.fault = HeartbeatLost("node 3 is silent", device="controller")

    lab.session.observers.watch(trip)
    with pytest.raises(HeartbeatLost, match="node 3"):
        async with asyncio.timeout(60.0):
            await lab.session.run()
    assert len(heard.of(ev.PromptAnswered)) == 1
    assert {"stop LabController", "stop LabTracker"} <= set(lab.room.log)


async def test_a_whole_plan_asks_for_each_smr_once_and_reads_every_nest(
    lab: Lab, heard: Heard
) -> None:
    """A person says that it is done; what they are told to put where is what the tracker sees."""
    session = lab.session
    session.work.unattended = False
    asked: list[str] = []

    def hear(event: ev.Event) -> None:
        if isinstance(event, ev.PromptNeeded):
            asked.append(event.text.split(",")[0])
            session.answer_prompt(event.prompt, "done")

    session.observers.watch(hear)
    outcome = await session.run()
    assert outcome.readings == 2 * 3 + 2 * 4
    assert asked == [f"Put SMR {smr} into nest {nest}" for smr, nest in enumerate("345", start=1)]
    taken = [(e.pose_label, e.nest) for e in heard.of(ev.ReadingTaken) if e.pose_label]
    assert taken == [*(("a", nest) for nest in "345"), *(("b", nest) for nest in "543")]
    assert all(e.miss_mm < 1e-9 for e in heard.of(ev.ReadingTaken))
    assert not heard.of(ev.AlarmRaised)
    assert not lab.controller.enabled


async def test_a_machine_is_kept_moving_on_ways_that_were_checked(
    tmp_path: Path, heard: Heard
) -> None:
    """Whole rounds, for as long as was said; what was done is not done again."""
    plan = warming_plan(lab_site(), {label: POSES[label] for label in "abc"}, 12.0)
    assert [one.args["minutes"] for one in plan.steps if one.kind is kinds.EXERCISE] == [5, 5, 2]
    lab = lab_in(tmp_path, plan=plan)
    lab.session.observers.watch(heard)
    outcome = await lab.session.run()
    went = [event.pose_label for event in heard.of(ev.PoseCommanded)]
    assert went[-1] == "home"
    assert set(pairwise(went)) <= set(pairwise(waypoints(plan)))
    assert outcome.readings == 0
    assert not outcome.run_folder.exists()
    assert lab.session.journal.last_time() >= 60.0 * 12.0
    again = [one.kind for one in Session.reopen(outcome.folder).due()]
    assert again == [kinds.CONNECT, kinds.CHECK_PATH, kinds.DRIVES]


@pytest.mark.parametrize(("poses", "minutes"), [({}, 5.0), ({"a": POSES["a"]}, 0.0)])
def test_nothing_is_warmed_up_in_no_time(poses: dict, minutes: float) -> None:
    with pytest.raises(BadInput, match="warm nothing up"):
        warming_plan(lab_site(), poses, minutes)
