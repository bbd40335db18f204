"""A drive of the mock by itself, on a clock that is turned by hand."""

from collections.abc import Iterator
from itertools import pairwise

import pytest
from canopen.sdo.exceptions import SdoAbortedError

from drivers.canopen.drive402 import (
    ACKNOWLEDGED,
    AT_ONCE,
    ENABLE,
    HOMING,
    LIMITED,
    NEW_SETPOINT,
    PROFILE_POSITION,
    QUICK_STOP,
    REACHED,
    SHUTDOWN,
    SWITCH_ON,
    state_name,
)
from mocks.canopen.drive402 import Drive
from mocks.canopen.server import CanopenStation
from mocks.clock import ManualClock
from mocks.world import World

MM = 1_000_000


class Bench:
    """One drive, its clock, and the objects that a master would write."""

    def __init__(self, drive: Drive, clock: ManualClock) -> None:
        self.drive, self.clock = drive, clock

    def write(self, index: int, value: int, sub: int = 0) -> None:
        variable = self.drive.object_dictionary.get_variable(index, sub)
        self.drive.set_data(index, sub, variable.encode_raw(value), check_writable=True)

    def control(self, *words: int) -> None:
        for word in words:
            self.write(0x6040, word)

    def enable(self, mode: int) -> None:
        self.write(0x6060, mode)
        self.control(SHUTDOWN, SWITCH_ON, ENABLE)

    def wait(self, seconds: float) -> int:
        """Let machine time pass; returns the statusword."""
        self.clock.advance(seconds)
        self.drive.tick()
        return self.status

    @property
    def status(self) -> int:
        return self.drive.statusword()

    @property
    def position(self) -> float:
        return self.drive.value(0x6064) / MM


@pytest.fixture
def bench() -> Iterator[Bench]:
    clock = ManualClock()
    station = CanopenStation(World(clock))
    station.start()
    # The station's own thread would tick in between.
    with station.network.lock:
        yield Bench(station.drives[0], clock)
    station.stop()


def test_setpoint_is_acknowledged_reached_and_released(bench: Bench):
    bench.enable(PROFILE_POSITION)
    bench.write(0x607A, 8 * MM)
    bench.control(ENABLE | NEW_SETPOINT)
    assert bench.status & ACKNOWLEDGED
    assert not bench.status & REACHED
    bench.control(ENABLE)
    assert not bench.status & ACKNOWLEDGED
    assert not bench.wait(0.2) & REACHED
    assert 0.0 < bench.position < 8.0
    assert bench.wait(5.0) & REACHED
    assert bench.position == 8.0


def test_second_setpoint_waits_for_the_first(bench: Bench):
    bench.enable(PROFILE_POSITION)
    for target in (5 * MM, -3 * MM):
        bench.write(0x607A, target)
        bench.control(ENABLE | NEW_SETPOINT, ENABLE)
    assert bench.status & ACKNOWLEDGED
    bench.wait(2.0)
    assert bench.position == 5.0
    assert not bench.status & ACKNOWLEDGED
    bench.wait(5.0)
    assert bench.position == -3.0


def test_setpoint_at_once_replaces_the_first(bench: Bench):
    bench.enable(PROFILE_POSITION)
    for target in (5 * MM, -3 * MM):
        bench.write(0x607A, target)
        bench.control(ENABLE | NEW_SETPOINT | AT_ONCE, ENABLE)
        bench.wait(0.1)
    bench.wait(5.0)
    assert bench.position == -3.0


def test_relative_setpoint_counts_from_the_last_target(bench: Bench):
    bench.enable(PROFILE_POSITION)
    for _ in range(3):
        bench.write(0x607A, 2 * MM)
        bench.control(ENABLE | NEW_SETPOINT | 1 << 6, ENABLE)
        bench.wait(5.0)
    assert bench.position == 6.0


def test_target_beyond_the_software_limit_stops_there(bench: Bench):
    bench.enable(PROFILE_POSITION)
    bench.write(0x607D, 10 * MM, sub=2)
    bench.write(0x607A, 50 * MM)
    bench.control(ENABLE | NEW_SETPOINT, ENABLE)
    assert bench.wait(20.0) & LIMITED
    assert bench.position == 10.0


def test_profile_keeps_to_its_velocity_and_acceleration(bench: Bench):
    bench.enable(PROFILE_POSITION)
    bench.write(0x6081, 10 * MM)
    bench.write(0x6083, 40 * MM)
    bench.write(0x607A, 20 * MM)
    bench.control(ENABLE | NEW_SETPOINT, ENABLE)
    step, positions = 0.01, [0.0]
    while not bench.status & REACHED:
        bench.wait(step)
        positions.append(bench.position)
    speeds = [(b - a) / step for a, b in pairwise(positions)]
    gains = [(b - a) / step for a, b in pairwise(speeds)]
    assert max(speeds) == pytest.approx(10.0, rel=0.01)
    assert max(map(abs, gains)) <= 40.0 * 1.01


def test_halt_brakes_and_stays_enabled(bench: Bench):
    bench.enable(PROFILE_POSITION)
    bench.write(0x607A, 20 * MM)
    bench.control(ENABLE | NEW_SETPOINT, ENABLE)
    bench.wait(0.5)
    bench.control(ENABLE | 1 << 8)
    bench.wait(0.1)
    stood = bench.position
    bench.wait(1.0)
    assert bench.position == stood < 20.0
    assert state_name(bench.status) == "operation enabled"


@pytest.mark.parametrize(("option", "state"), [(2, "switch on disabled"), (6, "quick stop active")])
def test_quick_stop_ends_as_its_option_says(bench: Bench, option: int, state: str):
    bench.enable(PROFILE_POSITION)
    bench.write(0x605A, option)
    bench.write(0x607A, 20 * MM)
    bench.control(ENABLE | NEW_SETPOINT, ENABLE)
    bench.wait(0.5)
    bench.control(QUICK_STOP)
    assert state_name(bench.status) == "quick stop active"
    assert state_name(bench.wait(0.2)) == state
    stood = bench.position
    bench.wait(1.0)
    assert bench.position == stood < 20.0


def test_homing_finds_the_mark_and_says_so(bench: Bench):
    bench.enable(PROFILE_POSITION)
    bench.write(0x607A, 8 * MM)
    bench.control(ENABLE | NEW_SETPOINT, ENABLE)
    bench.wait(5.0)
    bench.write(0x6060, HOMING)
    bench.control(ENABLE | NEW_SETPOINT)
    assert not bench.status & (ACKNOWLEDGED | REACHED)
    assert not bench.drive.referenced
    status = bench.wait(10.0)
    assert status & ACKNOWLEDGED
    assert status & REACHED
    assert bench.position == 0.0
    assert bench.drive.referenced


@pytest.mark.parametrize(("index", "value"), [(0x6060, 3), (0x6098, 17)])
def test_unsupported_modes_and_methods_are_refused(bench: Bench, index: int, value: int):
    with pytest.raises(SdoAbortedError) as error:
        bench.write(index, value)
    assert error.value.code == 0x0609_0030


def test_mode_does_not_change_under_way(bench: Bench):
    bench.enable(PROFILE_POSITION)
    bench.write(0x607A, 20 * MM)
    bench.control(ENABLE | NEW_SETPOINT, ENABLE)
    bench.wait(0.2)
    with pytest.raises(SdoAbortedError) as error:
        bench.write(0x6060, HOMING)
    assert error.value.code == 0x0800_0022
