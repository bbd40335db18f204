"""Parameters through the driver: written, proven, stored, brought back."""

import struct
import zlib

import pytest
from gcs_bench import Bench

from drivers.errors import ParameterError, ProtocolError, Refused
from drivers.gcs import GcsController
from drivers.gcs.layout import groups_of, read_layout
from mocks.physics.truth import draw_parameters, machine_file, nominal_parameters

MACHINE = machine_file("tripod")
NOMINAL = nominal_parameters(MACHINE)


async def test_fresh_controller_holds_the_nominal_values(controller: GcsController):
    assert await controller.read_parameters() == NOMINAL


@pytest.mark.parametrize("seed", range(3))
async def test_any_set_reads_back_bit_for_bit(controller: GcsController, seed: int):
    values = draw_parameters(MACHINE, seed)
    await controller.write_parameters(values)
    held = await controller.read_parameters()
    assert held == values
    crc = zlib.crc32(struct.pack("<9d", *held.values()))
    assert await controller.parameter_checksum() == crc


async def test_trial_is_undone_by_reloading(controller: GcsController):
    await controller.write_parameters({"limb1.h": 261.5})
    await controller.reload_parameters()
    assert await controller.read_parameters() == NOMINAL


async def test_stored_set_survives_a_power_cycle(bench: Bench, controller: GcsController):
    await controller.write_parameters({"limb1.h": 261.5})
    await controller.store_parameters()
    await controller.write_parameters({"limb1.h": 262.5})
    bench.station.power_cycle()
    assert (await controller.read_parameters())["limb1.h"] == 261.5


async def test_nothing_is_written_under_power(controller: GcsController):
    await controller.enable()
    with pytest.raises(Refused, match=r"limb1.l0 = 411.0.*servos are on.*Disable"):
        await controller.write_parameters({"limb1.l0": 411.0})
    with pytest.raises(Refused, match="servos are on"):
        await controller.store_parameters()


async def test_refused_store_leaves_the_stored_set(bench: Bench, controller: GcsController):
    await controller.write_parameters({"limb1.l0": 411.0})
    bench.world.faults.inject("store-refused")
    with pytest.raises(Refused, match=r"memory cannot be written.*old values") as refused:
        await controller.store_parameters()
    assert refused.value.code == 305
    await controller.reload_parameters()
    assert await controller.read_parameters() == NOMINAL


async def test_refused_write_names_the_parameter(bench: Bench, controller: GcsController):
    bench.world.faults.inject("write-refused:limb2.h")
    with pytest.raises(Refused, match=r"limb2\.h = 261") as refused:
        await controller.write_parameters({"limb1.h": 261.0, "limb2.h": 261.0})
    assert refused.value.code == 333
    assert bench.station.controller.level == 0, "the command level is given back"


@pytest.mark.parametrize("value", [float("nan"), float("inf"), 1e6])
async def test_senseless_value_is_refused(controller: GcsController, value: float):
    with pytest.raises(Refused, match=r"limb3\.l0"):
        await controller.write_parameters({"limb3.l0": value})
    assert await controller.read_parameters() == NOMINAL


async def test_value_that_does_not_stick_is_noticed(bench: Bench, controller: GcsController):
    bench.world.faults.inject("write-lost:limb3.theta")
    with pytest.raises(ParameterError, match=r"limb3\.theta"):
        await controller.write_parameters({"limb3.theta": 4.19, "limb3.h": 260.5})


async def test_unknown_name_is_refused_before_anything_is_written(controller: GcsController):
    with pytest.raises(ParameterError, match=r"leg1\.B_x"):
        await controller.write_parameters({"limb1.h": 261.0, "leg1.B_x": 1.0})
    assert await controller.read_parameters() == NOMINAL


async def test_eight_of_nine_parameters(bench: Bench, controller: GcsController):
    bench.world.faults.inject("parameter-missing:limb2.l0")
    with pytest.raises(ParameterError, match=r"8 of 9 parameters; missing: limb2\.l0"):
        await controller.read_parameters()


async def test_nan_is_named(bench: Bench, controller: GcsController):
    bench.world.faults.inject("parameter-nan:limb1.theta")
    with pytest.raises(ParameterError, match=r"nan for limb1\.theta"):
        await controller.read_parameters()


async def test_wrong_store_password(bench: Bench, controller: GcsController):
    await controller.close()
    other = await bench.connect(store_password="guess")
    with pytest.raises(Refused, match="wrong password"):
        await other.store_parameters()


async def test_wrong_level_password(bench: Bench, controller: GcsController):
    await controller.close()
    other = await bench.connect(level="CCL 1 guess")
    with pytest.raises(Refused, match="wrong password"):
        await other.write_parameters({"limb1.h": 261.0})


def test_limbs_may_be_called_otherwise() -> None:
    lines = [
        "0x7F010001=\t0\t3\tFLOAT\ttower\tzero",
        "0x7F030001=\t0\t1\tINT\tsystem\tCRC-32",
    ]
    groups = groups_of(["tower1.zero", "tower2.zero", "tower3.zero"])
    assert groups == {"tower"}
    layout = read_layout(lines, "here", groups)
    assert list(layout.parameters) == ["tower1.zero", "tower2.zero", "tower3.zero"]
    with pytest.raises(ProtocolError, match="group leg"):
        read_layout(lines, "here", groups_of(["leg1.L0"]))
