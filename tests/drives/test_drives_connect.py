"""What is found out before anything moves."""

from pathlib import Path

import pytest
from bare_lab import HOME, SHORT

from drivers.errors import ConnectFailed, DeviceError, Refused
from mocks.canopen.bare_eds import SCREW, bare_eds_path

COUNTS = SCREW.counts


async def test_all_drives_together_have_one_identity(bare):
    motors = await bare.connect()
    assert motors.identity.kind == "drives"
    assert motors.identity.serial == "-".join(map(str, bare.station.serials))
    assert (await motors.state()).enabled is False
    await bare.connect(serial=motors.identity.serial)


async def test_another_drive_than_before_is_refused(bare):
    with pytest.raises(Refused, match="expected 1-2-3"):
        await bare.connect(serial="1-2-3")


async def test_a_drive_that_is_off(bare):
    bare.world.faults.inject("heartbeat-silent:4")
    with pytest.raises(ConnectFailed, match=r"drive q4 \(node 4\) does not.*switched on"):
        await bare.connect(silence_s=SHORT)


async def test_a_wrong_node_number(bare):
    with pytest.raises(ConnectFailed, match=r"drive q6 \(node 16\) does not.*node number"):
        await bare.connect(nodes=(1, 2, 3, 4, 5, 16))


def edited(folder: Path, old: str, new: str) -> list[str]:
    text = bare_eds_path("mm").read_text(encoding="utf-8")
    assert old in text
    path = folder / "edited.eds"
    path.write_text(text.replace(old, new), encoding="utf-8")
    return [str(path)]


async def test_the_eds_file_of_another_drive(bare, tmp_path):
    eds = edited(tmp_path, "ProductNumber=0xBA5E", "ProductNumber=0x77")
    with pytest.raises(Refused, match=r"q1 .*is product 0xBA5E, its EDS file .* 0x77"):
        await bare.connect(eds=eds)


async def test_a_file_that_is_no_eds_file(bare, tmp_path):
    path = tmp_path / "photo.eds"
    path.write_bytes(b"\x89PNG\r\n\x1a\n\x00\xff")
    with pytest.raises(DeviceError, match=r"photo.eds cannot be read as an EDS file"):
        await bare.connect(eds=[str(path)])
    with pytest.raises(DeviceError, match=r"missing.eds cannot be read"):
        await bare.connect(eds=[str(tmp_path / "missing.eds")])


async def test_the_eds_file_of_no_drive(bare, tmp_path):
    eds = edited(tmp_path, "[607A]", "[2F00]")
    with pytest.raises(DeviceError, match="no object 0x607A: it is not that of a CiA 402 drive"):
        await bare.connect(eds=eds)


async def test_units_that_disagree_with_the_drive(bare):
    with pytest.raises(Refused, match=r"209715\.2 counts in one mm by 0x608F.*= 200000"):
        await bare.connect(counts_per_unit=(200_000.0,) * 6)


@pytest.mark.parametrize("feed_unit", [0.0, 0.001])
async def test_units_that_agree(bare, feed_unit):
    motors = await bare.connect(counts_per_unit=(COUNTS,) * 6, feed_unit=feed_unit)
    assert [a.position for a in (await motors.state()).actuators] == pytest.approx(HOME)


async def test_units_that_nobody_says(bare):
    with pytest.raises(Refused, match=r"does not say how many counts.*counts_per_unit"):
        await bare.connect(feed_unit=0.0)


async def test_what_a_drive_does_at_a_stop_and_without_the_pc_is_written(bare):
    await bare.connect(quick_stop=6, on_silence=3, silence_s=0.6)
    for number in range(1, 7):
        drive = bare.drive(number)
        assert (drive.value(0x605A), drive.value(0x6007)) == (6, 3)
        assert drive.value(0x1016, 1) == 127 << 16 | 600


async def test_a_drive_that_does_not_take_it(bare):
    with pytest.raises(Refused, match=r"cannot be told to brake at a stop.*0x605A = 4"):
        await bare.connect(quick_stop=4)


async def test_a_drive_that_reads_back_otherwise(bare):
    bare.drive(2).readers[0x6007, 0] = lambda: 0
    with pytest.raises(Refused, match=r"q2 .*stop when this PC is silent.*it holds 0"):
        await bare.connect()


async def test_limits_are_those_of_the_machine_but_never_wider_than_the_drive_s(bare):
    bare.drive(3).keep(0x607D, 2, round(10.0 * COUNTS))
    await bare.connect(lower=(200.0, *[195.0] * 5))
    assert bare.drive(1).value(0x607D, 1) == pytest.approx((200.0 - HOME[0]) * COUNTS, abs=1.0)
    assert bare.drive(3).value(0x607D, 2) == round(10.0 * COUNTS)
    # Drive 2 counts backwards: its upper limit is the lowest q.
    assert bare.drive(2).value(0x607D, 2) == pytest.approx((HOME[1] - 195.0) * COUNTS, abs=1.0)


async def test_the_drive_s_own_limits_come_back_at_the_end(bare):
    drive = bare.drive(1)
    held = drive.value(0x607D, 1), drive.value(0x607D, 2)
    motors = await bare.connect(lower=(225.0, *[195.0] * 5))
    assert drive.value(0x607D, 1) > held[0]
    await motors.close()
    assert (drive.value(0x607D, 1), drive.value(0x607D, 2)) == held


async def test_limits_that_have_nothing_in_common(bare):
    drive = bare.drive(1)
    drive.keep(0x607D, 1, round(100.0 * COUNTS))
    drive.keep(0x607D, 2, round(120.0 * COUNTS))
    with pytest.raises(Refused, match=r"q1 .*none of it within"):
        await bare.connect()


async def test_a_drive_that_knows_its_place_and_stands_where_it_cannot(bare):
    await bare.ready()
    with pytest.raises(Refused, match=r"q1 .*stands at 290\.7.*outside 195 to 265.*sign, offset"):
        await bare.connect(offset=(HOME[0] + 60.0, *HOME[1:]))


async def test_a_mode_that_the_drive_does_not_have(bare):
    bare.drive(5).readers[0x6502, 0] = lambda: 0b10_0001
    with pytest.raises(Refused, match=r"q5 .*mode of operation 8"):
        await bare.connect(mode="cyclic")
