"""A closed hexapod: poses in its own words, what they refer to, and what it says of itself."""

import math
import sys
from collections.abc import AsyncIterator

import numpy as np
import pytest
from gcs_bench import running, tcp_port
from hexapod_bench import HOME, THERE, HexapodBench, SixLegs, until

from drivers.errors import ConnectFailed, Refused
from drivers.gcs.conventions import ORDERS, OURS, Convention, angles, rotation
from drivers.gcs.kind import KIND as GCS
from drivers.kind import ActuatorFacts, Surroundings
from mocks.canopen.hexapod_kinematics import HexapodKinematics
from mocks.gcs.hexapod_frames import motion_of
from mocks.gcs.server import GcsStation
from mocks.physics.truth import machine_file, nominal_parameters

NOMINAL = nominal_parameters(machine_file("hexapod"))
LINES = [
    "tcp",
    pytest.param("pty", marks=pytest.mark.skipif(sys.platform == "win32", reason="no pty")),
]


@pytest.fixture(params=LINES)
async def bench(request: pytest.FixtureRequest) -> AsyncIterator[HexapodBench]:
    """A closed hexapod, once over TCP and once over a serial line; nobody is connected."""
    world = SixLegs()
    with running(GcsStation(world, serial=77, pose=True)) as station:
        port = tcp_port(station) if request.param == "tcp" else station.pty_path
        made = HexapodBench(world, station, port)
        await until(lambda: not station.controller.busy)
        yield made
        if made.mover is not None:
            await made.mover.close()


def legs_of(pose: tuple[float, ...]) -> np.ndarray:
    """Extensions of the drawn machine at one of our poses."""
    lengths = HexapodKinematics().targets(pose, NOMINAL)
    return np.array(lengths) - NOMINAL["leg1.L0"]


# ---------------------------------------------------------------- conventions


@pytest.mark.parametrize("order", ORDERS)
def test_angles_and_rotation_are_inverse_and_a_product_of_matrices(order: str) -> None:
    generator = np.random.default_rng(3)
    for turn in generator.uniform(-1.4, 1.4, (20, 3)):
        rows = np.array(rotation(tuple(turn), order))
        assert np.allclose(rows @ rows.T, np.eye(3), atol=1e-14)
        assert np.linalg.det(rows) == pytest.approx(1.0)
        assert angles(tuple(map(tuple, rows)), order) == pytest.approx(tuple(turn), abs=1e-12)
        one_by_one = np.eye(3)
        for word in order.split():
            alone = [0.0, 0.0, 0.0]
            alone["xyz".index(word[1])] = turn["xyz".index(word[1])]
            one_by_one = one_by_one @ np.array(rotation(tuple(alone), OURS))
        assert np.allclose(rows, one_by_one, atol=1e-14)


@pytest.mark.parametrize("order", ORDERS)
def test_what_is_written_reads_back(order: str) -> None:
    convention = Convention(order, True, (1.0, -2.0, 220.0), (5.0, 7.0, -30.0))
    assert convention.read(convention.written(THERE)) == pytest.approx(THERE, abs=1e-12)


def test_about_its_pivot_a_turn_moves_the_origin_and_not_the_pivot() -> None:
    convention = Convention("Rx Ry Rz", True, (0.0, 0.0, 220.0), (0.0, 0.0, 50.0))
    x, _, z, *_ = convention.read((0.0, 0.0, 0.0, 0.0, 10.0, 0.0))
    assert x == pytest.approx(-50.0 * math.sin(math.radians(10.0)))
    assert z == pytest.approx(220.0 + 50.0 * (1.0 - math.cos(math.radians(10.0))))


def test_it_is_the_convention_of_the_mock_which_was_written_by_itself() -> None:
    pivot = (3.0, -4.0, 60.0)
    convention = Convention("Rx Ry Rz", True, (0.0, 0.0, 220.0), pivot)
    turn, place = motion_of(convention.written(THERE), np.array(pivot))
    assert np.allclose(turn, np.array(rotation(THERE[3:], OURS)), atol=1e-14)
    assert place == pytest.approx((6.0, -8.0, 6.0), abs=1e-12)


# ---------------------------------------------------------------- on the wire


async def test_a_pose_arrives_as_legs_of_the_drawing(bench: HexapodBench) -> None:
    mover = await bench.ready()
    for pose in (THERE, HOME):
        await mover.move_pose(pose)
        await mover.wait_arrived(10.0)
        there = np.array([leg.position() for leg in bench.world.legs])
        assert there == pytest.approx(legs_of(pose), abs=1e-8)
        assert await mover.commanded_pose() == pytest.approx(pose, abs=1e-9)
        state = await mover.state()
        assert tuple(axis.position for axis in state.actuators) == pytest.approx(pose, abs=1e-8)
        assert state.enabled
        assert not state.moving


@pytest.mark.parametrize("pivot", [(0.0, 0.0, 0.0), (2.0, -5.0, 40.0)])
async def test_the_pivot_changes_the_numbers_and_not_the_pose(bench: HexapodBench, pivot) -> None:
    mover = await bench.ready(pivot=pivot, set_frame=True)
    await mover.move_pose(THERE)
    await mover.wait_arrived(10.0)
    there = np.array([leg.position() for leg in bench.world.legs])
    assert there == pytest.approx(legs_of(THERE), abs=1e-8)


async def test_it_says_what_its_poses_refer_to(bench: HexapodBench) -> None:
    bench.obey("KSD WORK1 X 1 W 2")
    mover = await bench.connect(system=["WORK1"], pivot=(0.0, 0.0, 12.5), set_frame=True)
    assert await mover.frame() == {
        "system": "WORK1", "pivot": "0 0 12.5", "rotation": "Rx Ry Rz", "angle_unit": "deg",
        "origin": "0 0 220", "axes": "X Y Z U V W",
    }  # fmt: skip
    assert bench.obey("SPI? T") == "T=12.5000000000\n"
    assert bench.obey("KEN?") == "WORK1=KSD\n"


async def test_velocity_goes_to_the_platform(bench: HexapodBench) -> None:
    await bench.connect(velocity_mm_s=3.5)
    assert bench.obey("VLS?") == "3.5000000000\n"


# ---------------------------------------------------------------- refused with words


@pytest.mark.parametrize(
    ("before", "changes", "kind", "says"),
    [
        ("KSD LAB X 1", {"system": ["LAB"]}, Refused, "coordinate system is ZERO, LAB is wanted"),
        ("SPI T 5", {}, Refused, "pivot is 0 0 5 mm, 0 0 0 mm is wanted"),
        ("", {"angle_unit": "rad"}, Refused, "axis U in DEG, the site file in rad"),
        ("", {"axes": list("ABCUVW")}, ConnectFailed, "has the axes X Y Z U V W, not A B C"),
        ("", {"axes": list("UVWXYZ")}, Refused, "axis U in DEG, the site file in mm"),
        ("", {"system": ["NO"], "set_frame": True}, Refused, "no coordinate system of that name"),
        ("", {"serial": "78"}, Refused, "serial number 77, expected 78"),
        ("", {"velocity_mm_s": 900.0}, Refused, "velocity outside limits"),
    ],
)
async def test_at_connect(bench: HexapodBench, before, changes, kind, says) -> None:
    bench.obey(before)
    with pytest.raises(kind, match=says):
        await bench.connect(**changes)


@pytest.mark.parametrize(
    ("meanwhile", "says"),
    [
        ("SPI R 0.5", "pivot is 0.5 0 0 mm"),
        ("KEN LAB", "coordinate system is LAB, ZERO is wanted"),
    ],
)
async def test_somebody_changes_the_frame_between_two_moves(
    bench: HexapodBench, meanwhile: str, says: str
) -> None:
    bench.obey("KSD LAB Z 3")
    mover = await bench.ready()
    await mover.move_pose(THERE)
    await mover.wait_arrived(10.0)
    bench.obey(meanwhile)
    with pytest.raises(Refused, match=says):
        await mover.move_pose(HOME)
    assert not bench.world.moving


@pytest.mark.parametrize(
    ("pose", "says"),
    [
        ((0.0, 0.0, 300.0, 0.0, 0.0, 0.0), "axis Z = 80 is outside the controller's limits"),
        ((29.0, 29.0, 240.0, 0.3, 0.3, 0.4), "says that it cannot go to X"),
        ((0.0, 0.0, math.nan, 0.0, 0.0, 0.0), "a pose has 6 finite numbers"),
        ((0.0, 0.0, 220.0), "a pose has 6 finite numbers"),
    ],
)
async def test_no_such_pose(bench: HexapodBench, pose: tuple[float, ...], says: str) -> None:
    mover = await bench.ready()
    with pytest.raises(Refused, match=says):
        await mover.move_pose(pose)
    assert not bench.world.moving
    await mover.move_pose(THERE)
    await mover.wait_arrived(10.0)


async def test_without_a_reference_or_without_power_nothing_moves(bench: HexapodBench) -> None:
    mover = await bench.connect()
    with pytest.raises(Refused, match="does not know its reference"):
        await mover.home("x")
    await mover.enable()
    assert not any(axis.homed for axis in (await mover.state()).actuators)
    with pytest.raises(Refused, match="does not know its reference"):
        await mover.move_pose(THERE)
    await mover.home("rz")
    assert all(axis.homed for axis in (await mover.state()).actuators)


# ---------------------------------------------------------------- kind gcs with angles


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({}, "angle_unit and rotation is not stated"),
        ({"angle_unit": "deg"}, "rotation is not stated"),
        ({"pose_axes": list("XYZU")}, "names 4 axes"),
    ],
)
async def test_a_kinematic_controller_with_angles_must_say_how_it_counts_them(
    changes: dict[str, object], says: str
) -> None:
    settings = {one.name: one.default for one in GCS.settings}
    settings |= {"port": "socket://127.0.0.1:9", "pose_axes": list("XYZUVW"), **changes}
    facts = tuple(ActuatorFacts(f"q{n}", "mm", 0.0, (-1.0, 1.0)) for n in (1, 2, 3))
    with pytest.raises(Refused, match=says):
        await GCS.open(Surroundings(settings, "", "tripod", facts, {}))
