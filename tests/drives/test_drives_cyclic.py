"""Cyclic synchronous position: what is sent at SYNC, and drives that do not follow it."""

import asyncio
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bare_lab import FAR, HOME, LOADED, SHORT, Bare
from canopen.sdo.exceptions import SdoAbortedError

from app.files.machines import load_machine
from app.hosted.controller import HostedController
from app.hosted.means import ByMotors
from app.hosted.parameters import ParameterSet
from app.hosted.store import HostStore
from calib.mechanism.solve import forward
from drivers.drives.motors import DriveMotors
from drivers.errors import DeviceFault, DriveFault, Refused

Frames = list[tuple[int, bytes]]
ROUNDED = 2.0
"""Counts by which differences of rounded set-points may be off."""


async def until(true: Callable[[], bool], timeout: float = 20.0) -> None:
    async with asyncio.timeout(timeout):
        while not true():  # noqa: ASYNC110 - a plain value, not an event
            await asyncio.sleep(0.005)


class Wire:
    """What a stream sends: set-points in counts, a row each SYNC, and when each row was sent."""

    def __init__(self, motors: DriveMotors, delay: Callable[[], float] = float) -> None:
        self.rows: list[tuple[int, ...]] = []
        self.times: list[float] = []
        link = motors._bus.link
        send: Any = link.send_now

        def noted(frames: Frames) -> None:
            points = [data for cob_id, data in frames if 0x301 <= cob_id <= 0x306]
            if len(points) == 6:
                time.sleep(delay())
                self.rows.append(tuple(int.from_bytes(p, "little", signed=True) for p in points))
                self.times.append(time.monotonic())
            send(frames)

        link.send_now = noted  # type: ignore[method-assign]

    def must_be_smooth(self, motors: DriveMotors) -> None:
        """Set-points go no further in a period than speed and acceleration allow."""
        period, axes = motors._plan.sync_s, motors._bus.axes
        steps = np.diff(self.rows, axis=0)
        fastest = np.array([axis.speed * abs(axis.scale) for axis in axes])
        hardest = np.array([axis.acceleration * abs(axis.scale) for axis in axes])
        assert (np.abs(steps) <= fastest * period + ROUNDED).all()
        assert (np.abs(np.diff(steps, axis=0)) <= hardest * period**2 + 2.0 * ROUNDED).all()


async def cyclic(bare: Bare, **changes: Any) -> DriveMotors:
    """On and referenced at once; each has crept along in a profile before."""
    for number in range(1, 7):
        bare.drive(number).attain()
        bare.drive(number).keep(0x6081, 0, 1)
    motors = await bare.connect(mode="cyclic", **changes)
    await motors.enable()
    return motors


@pytest.mark.long
async def test_set_points_arrive_together_and_homing_goes_between(bare: Bare):
    motors = await cyclic(bare)
    await motors.move_actuators(FAR)
    await motors.wait_arrived(20.0)
    positions = [leg.position() for leg in bare.world.legs]
    ways = [far - home for far, home in zip(FAR, HOME, strict=True)]
    assert positions == pytest.approx(ways, abs=1e-4)
    await motors.home("q2")
    await motors.move_actuators(HOME)
    await motors.wait_arrived(20.0)
    await motors.stop()
    assert not (await motors.state()).enabled


async def test_a_computer_that_is_late_makes_a_motion_longer_but_never_faster(bare: Bare):
    def late() -> float:
        moved = sum(row != wire.rows[0] for row in wire.rows)
        return 0.3 if moved in (20, 40) else 0.0

    motors = await cyclic(bare)
    wire = Wire(motors, late)
    await motors.move_actuators(FAR)
    await motors.wait_arrived(20.0)
    wire.must_be_smooth(motors)
    # No SYNC hurries after a late one.
    assert min(b - a for a, b in pairwise(wire.times)) > 0.4 * motors._plan.sync_s
    await until(lambda: any("SYNC came late" in alarm.what for alarm in bare.alarms))
    assert not any(alarm.fault for alarm in bare.alarms)


@pytest.mark.long
async def test_another_target_under_way_is_gone_to_without_a_jerk(bare: Bare):
    motors = await cyclic(bare)
    wire = Wire(motors)
    await motors.move_actuators(FAR)
    first = asyncio.ensure_future(motors.wait_arrived(20.0))
    await until(lambda: bare.world.legs[0].position() > 3.0)
    await motors.move_actuators(HOME)
    with pytest.raises(DeviceFault, match="another motion took the place"):
        await first
    await motors.wait_arrived(20.0)
    assert [leg.position() for leg in bare.world.legs] == pytest.approx([0.0] * 6, abs=1e-4)
    wire.must_be_smooth(motors)


async def test_a_drive_that_leaves_the_mode_stops_all_and_moves_no_more(bare: Bare):
    motors = await cyclic(bare)
    await motors.move_actuators(FAR)
    await until(lambda: bare.world.legs[0].position() > 1.0)
    bare.world.faults.inject("leaves-mode:4")
    with pytest.raises(DeviceFault, match=r"q4 .*has left mode 8.* mode 1 \(0x6061\)"):
        await motors.wait_arrived(20.0)
    await until(lambda: not bare.moving)
    assert bare.world.legs[0].position() < 15.0
    await motors.enable()
    bare.world.faults.inject("leaves-mode:4")
    await until(lambda: bare.drive(4).mode == 1)
    with pytest.raises(DeviceFault, match=r"q4 .*has left mode 8"):
        await motors.move_actuators(HOME)
    await motors.enable()
    await motors.move_actuators(HOME)
    await motors.wait_arrived(20.0)


@pytest.mark.parametrize(
    ("watches_us", "silence_s", "says"),
    [(0, SHORT, r"q2 .*stands .* from its set-point for 0\.6 s.*SYNC"), (20_000, LOADED, "0x8700")],
)
async def test_a_drive_that_hears_no_sync_stops_all(
    bare: Bare, watches_us: int, silence_s: float, says: str
):
    motors = await cyclic(bare, speed=(4.0,) * 6, silence_s=silence_s)
    bare.drive(2).keep(0x1006, 0, watches_us)
    await motors.move_actuators(FAR)
    await until(lambda: bare.world.legs[0].position() > 0.5)
    bare.world.faults.inject("sync-lost:2")
    with pytest.raises(DriveFault, match=says):
        await motors.wait_arrived(20.0)
    await until(lambda: not bare.moving)
    assert bare.world.legs[0].position() < 15.0


async def test_drives_that_were_stopped_are_sent_no_further_set_points(bare: Bare):
    motors = await cyclic(bare)
    wire = Wire(motors)
    await motors.move_actuators(FAR)
    await until(lambda: bare.world.legs[0].position() > 1.0)
    await motors._bus.send_stop()
    with pytest.raises(DeviceFault, match="stopped before it reached"):
        await motors.wait_arrived(20.0)
    rows = len(wire.rows)
    await until(lambda: len(wire.rows) > rows + 5)
    assert len(set(wire.rows[rows:])) == 1


def loop(rows: int, size: float) -> list[tuple[float, ...]]:
    """A way that comes back to home, at rest at both ends."""
    turn = np.linspace(0.0, 1.0, rows)
    angle = 2.0 * np.pi * turn**3 * (10.0 - 15.0 * turn + 6.0 * turn**2)
    ways = size * np.stack([1.0 - np.cos(angle), np.sin(angle), np.cos(angle) - 1.0])
    return [tuple(row) for row in np.array(HOME) + np.concatenate([ways, -ways]).T]


@pytest.mark.long
async def test_a_trajectory_is_played_as_it_was_written(bare: Bare):
    motors = await cyclic(bare)
    wire, rows = Wire(motors), loop(80, 0.4)
    await motors.play_actuators(rows, motors._plan.sync_s)
    with pytest.raises(Refused, match="another motion is under way"):
        await motors.move_actuators(HOME)
    await motors.wait_arrived(20.0)
    wire.must_be_smooth(motors)
    axes = motors._bus.axes
    wanted = np.array([[a.to_counts(q) for a, q in zip(axes, row, strict=True)] for row in rows])
    sent = np.array(wire.rows)
    begun, told = (int(np.argmax((of != wanted[0]).any(axis=1))) for of in (sent, wanted))
    assert np.abs(sent[begun:][: len(wanted) - told] - wanted[told:]).max() <= 1


@pytest.mark.long
async def test_poses_are_played_with_what_the_host_compensates(bare: Bare, tmp_path: Path):
    machine, store = load_machine("hexapod"), HostStore(tmp_path, load_machine("hexapod"))
    lost = {f"backlash.{axis.name}": 0.02 for axis in machine.axes}
    store.open()
    store.save(ParameterSet({**ParameterSet.nominal(machine).values, **lost}))
    motors = await cyclic(bare)
    wire, host = Wire(motors), HostedController(machine, ByMotors(motors, machine), store)
    turn = np.linspace(0.0, 1.0, 150)
    angle = 2.0 * np.pi * turn**3 * (10.0 - 15.0 * turn + 6.0 * turn**2)
    at = np.array(forward(machine, machine.extension(machine.home_q[:, None])).poses.to_xyz_rpy())
    poses = [tuple(at[:, 0] + [0.5 * np.sin(a), 0.5 - 0.5 * np.cos(a), 0, 0, 0, 0]) for a in angle]
    await host.move_to_pose(poses[0])
    await host.wait_arrived(20.0)
    rows = await host.play_poses(poses, 0.01)
    await host.wait_arrived(20.0)
    wire.must_be_smooth(motors)
    assert rows.shape == (150, 6)
    stands = [q + leg.position() for q, leg in zip(HOME, bare.world.legs, strict=True)]
    assert stands == pytest.approx(tuple(rows[-1]), abs=1e-3)
    with pytest.raises(Refused, match="pose 2 of the trajectory"):
        await host.play_poses([poses[0], (900.0, *poses[0][1:])], 0.01)
    for nothing, every_s in (([], 0.01), (poses, -0.01), (poses, float("nan"))):
        with pytest.raises(Refused):
            await host.play_poses(nothing, every_s)
    await host.close()


async def test_a_trajectory_that_cannot_be_played_moves_nothing(bare: Bare):
    motors = await cyclic(bare)
    for rows, every_s, says in (
        (loop(100, 1.0)[20:], 0.01, "begins at q1 .* Move to its first row"),
        (loop(20, 5.0), 0.01, r"row \d+: q\d has speed .* allowed are"),
        ([HOME, (HOME[0] + 0.1, *HOME[1:])], 0.01, r"row \d: q1 has acceleration"),
        ([HOME, (300.0, *HOME[1:])], 100.0, "row 2: q1 = 300 mm is outside"),
        ([HOME, HOME[:-1]], 0.01, "row 2: 6 finite values"),
        ([], 0.01, "0 rows .* are no trajectory"),
        ([HOME], float("nan"), "are no trajectory"),
    ):
        with pytest.raises(Refused, match=says):
            await motors.play_actuators(rows, every_s)
    assert not bare.moving


async def test_drives_with_profiles_of_their_own_play_nothing(bare: Bare):
    motors = await bare.connect()
    with pytest.raises(Refused, match='mode = "cyclic"'):
        await motors.play_actuators([HOME], 0.01)


async def test_a_drive_that_cannot_map_its_pdos_is_no_cyclic_one(bare: Bare):
    def refuse(_: int) -> None:
        raise SdoAbortedError(0x0604_0041)

    bare.drive(6).writers[0x1601, 1] = refuse
    with pytest.raises(Refused, match=r"q6 .*RPDO 2.*profile"):
        await bare.connect(mode="cyclic")


async def test_a_drive_that_listens_elsewhere_for_sync_is_refused(bare: Bare):
    bare.drive(3).keep(0x1005, 0, 0x90)
    with pytest.raises(Refused, match=r"q3 .*SYNC at COB-ID 0x90 \(0x1005\)"):
        await bare.connect(mode="cyclic")
