"""Both orders of a campaign through the wires, and the run that they leave."""

import sqlite3
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from session_mock import POSES, Heard, Mock

from app.files.runs import read_run
from app.session import events as ev
from app.session.plans import Order, PlanOptions, measure_plan
from app.session.session import Session
from calib.identify import fit
from calib.model import Model
from calib.runs import Run
from calib.runs.stack import stack

OPTIONS = PlanOptions(reference_every=3, warm_up=False)


def watch_the_journal(session: Session) -> None:
    """Let another connection find what is told in the journal at the moment when it is told."""
    viewer = sqlite3.connect(session.folder / "journal.sqlite")
    started: list[str] = []

    def hear(event: ev.Event) -> None:
        if isinstance(event, ev.StepStarted):
            started.append(event.step)
        if isinstance(event, ev.ReadingTaken):
            good = "FROM rows WHERE kind = 'reading' AND status = 'good'"
            assert viewer.execute(f"SELECT count(*) {good}").fetchone() == (event.number,)
            last = f"SELECT step, nest, time_s {good} ORDER BY seq DESC LIMIT 1"
            assert viewer.execute(last).fetchone() == (started[-1], event.nest, event.time_s)
        if isinstance(event, ev.ReadingTaken | ev.FrameFound | ev.DriftChecked | ev.StepDone):
            end = viewer.execute("SELECT step, state FROM log ORDER BY seq DESC LIMIT 1")
            assert end.fetchone() == (started[-1], "done")

    session.observers.watch(hear)


def arrivals(session: Session) -> list[tuple[float, float]]:
    """For each move machine times between which it arrived: its command, and when it was told."""
    times: list[tuple[float, float]] = []
    commanded = [0.0]

    def hear(event: ev.Event) -> None:
        if isinstance(event, ev.PoseCommanded):
            commanded.append(event.time_s)
        if isinstance(event, ev.LivePose) and not event.moving and event.q == event.target:
            times.append((commanded[-1], session.station.clock.now()))

    session.observers.watch(hear)
    return times


def delays_are_from_arrival_to_dwell(
    run: Run, session: Session, arrived: list[tuple[float, float]]
) -> None:
    """A delay leads from the begin of the dwell back to the arrival, over the settling."""
    window = session.station.site.limits.settle_window_s
    rounding = 2e-3
    for time_s, delay_s, pose in zip(run.time_s, run.channels["delay_s"], run.pose, strict=True):
        if not pose or np.isnan(delay_s):
            continue
        sent, told = max(pair for pair in arrived if pair[0] <= time_s)
        assert delay_s >= window - rounding
        assert sent - rounding <= time_s - delay_s <= told + rounding


@pytest.mark.long
@pytest.mark.parametrize(
    ("order", "smrs", "moves"), [("nest-by-nest", "1", 18), ("pose-by-pose", "3", 6)]
)
async def test_a_campaign_leaves_a_run_that_loads_and_fits(
    mock_of: Callable[..., Mock],
    heard: Heard,
    tmp_path: Path,
    order: Order,
    smrs: str,
    moves: int,
) -> None:
    mock = mock_of("--smrs", smrs, "--seed", "4")
    options = PlanOptions(order=order, reference_every=3, warm_up=False)
    session = Session.create(
        mock.site, measure_plan(mock.site, POSES, options), tmp_path, unattended=True
    )
    session.observers.watch(heard)
    watch_the_journal(session)
    arrived = arrivals(session)
    try:
        outcome = await session.run()
    finally:
        await session.close()
    platform = [r for r in heard.of(ev.ReadingTaken) if r.pose_label]
    assert len(platform) == 18
    assert len([m for m in heard.of(ev.PoseCommanded) if m.pose_label != "home"]) >= moves
    loaded = read_run(outcome.run_folder)
    assert loaded.run.header.controller_parameters["leg1.L0"] == 230.715
    found = fit(Model(stack(loaded.machine, [loaded.run]), []))
    assert found.readings == outcome.readings == sum(bool(nest) for nest in loaded.run.nest)
    assert 0.4 < found.chi2_per_dof < 2.5
    delays_are_from_arrival_to_dwell(loaded.run, session, arrived)


@pytest.mark.long
async def test_base_nests_without_their_own_smrs_are_visited_with_the_one(
    mock_of: Callable[..., Mock], heard: Heard, tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "1", "--no-base-smrs")
    poses = {label: POSES[label] for label in "ab"}
    session = Session.create(
        mock.site, measure_plan(mock.site, poses, OPTIONS), tmp_path, unattended=True
    )
    try:
        outcome = await session.run()
    finally:
        await session.close()
    assert outcome.readings == 2 * 3 + 4 * 3  # start, after the third pose, end


async def test_a_repeated_pose_carries_its_cycle(
    mock_of: Callable[..., Mock], tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3")
    options = PlanOptions(order="pose-by-pose", cycles=2, warm_up=False, two_face=False)
    poses = {label: POSES[label] for label in "ab"}
    session = Session.create(
        mock.site, measure_plan(mock.site, poses, options), tmp_path, unattended=True
    )
    try:
        outcome = await session.run()
    finally:
        await session.close()
    text = (outcome.run_folder / "points.csv").read_text(encoding="utf-8")
    header = text.splitlines()[0].split(",")
    column = header.index("cycle")
    cycles = [line.split(",")[column] for line in text.splitlines()[1:]]
    assert cycles.count("1") == cycles.count("2") == 6
