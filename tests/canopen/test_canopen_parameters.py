"""Parameters over the wire: written bit by bit, refused, stored, lost and brought back."""

import math
import struct
import zlib
from pathlib import Path

import pytest

from drivers.canopen import CanopenController
from drivers.canopen import layout as at
from drivers.canopen.device import Device
from drivers.canopen.parameter_access import ParameterAccess
from drivers.errors import ParameterError, Refused
from mocks.physics.truth import machine_file


async def test_controller_holds_the_machine_file_s_nominal_values(controller: CanopenController):
    held = await controller.read_parameters()
    machine = machine_file("hexapod")
    assert {p.name: p.nominal for p in machine.parameters} == {
        name: held[name] for name in controller.layout.kinematic
    }
    assert len(controller.layout.kinematic) == 54
    assert not any(held[name] for name in controller.layout.compensation)


async def test_what_is_written_is_read_back_bit_for_bit(controller: CanopenController):
    values = {"leg3.B_x": -127.1 - 1e-13, "leg6.L_P": 5.0 + 2**-50, "backlash.leg2": 0.1}
    await controller.write_parameters(values)
    held = await controller.read_parameters()
    assert all(struct.pack("<d", held[n]) == struct.pack("<d", v) for n, v in values.items())


class WithASecondWriter:
    """The controller node, to which somebody else writes as soon as one block was read."""

    def __init__(self, device: Device, address: tuple[int, int], value: float) -> None:
        self.label = device.label
        self._device, self._address, self._value = device, address, value

    def upload(self, index: int, sub: int = 0) -> bytes:
        data = self._device.upload(index, sub)
        if index == at.KINEMATIC_BLOCK:
            self._device.download(*self._address, struct.pack("<d", self._value))
        return data


@pytest.mark.parametrize("name", ["leg2.B_x", "backlash.leg3"])
async def test_a_set_that_changes_between_its_blocks_is_refused(
    controller: CanopenController, name: str
):
    """The blocks are of two sets then: each carries the checksum of its own."""
    device, layout = controller._bus.controller, controller.layout
    value = (await controller.read_parameters())[name]
    meddled = WithASecondWriter(device, layout.parameters[name], value + 0.25)
    with pytest.raises(ParameterError, match="checksum"):
        await device.call(ParameterAccess(meddled, layout).read)
    assert (await controller.read_parameters())[name] == value + 0.25


async def test_checksum_is_the_crc32_of_all_values_in_order(controller: CanopenController):
    before = await controller.parameter_checksum()
    await controller.write_parameters({"screw-pitch.leg5": 1e-4})
    held = await controller.read_parameters()
    expected = zlib.crc32(struct.pack(f"<{len(held)}d", *held.values()))
    assert await controller.parameter_checksum() == expected != before


@pytest.mark.long
async def test_every_parameter_has_its_own_entry_with_the_value_of_the_block(
    controller: CanopenController,
):
    await controller.write_parameters(
        {
            name: 0.001 * n
            for n, name in enumerate(controller.layout.compensation)
            if "table" in name
        }
        | {f"screw-cyclic-table.leg{n}.period": 2.0 for n in range(1, 7)}
    )
    block = await controller.read_parameters()
    device = controller._bus.controller

    def singly() -> dict[str, float]:
        places = controller.layout.parameters.items()
        return {name: struct.unpack("<d", device.upload(*at))[0] for name, at in places}

    assert await device.call(singly) == block


@pytest.mark.parametrize("value", [math.nan, math.inf, 500.0])
async def test_senseless_value_is_refused_and_the_old_one_stays(
    controller: CanopenController, value: float
):
    before = await controller.read_parameters()
    with pytest.raises(Refused, match=r"leg2\.L0") as refused:
        await controller.write_parameters({"leg2.L0": value})
    assert refused.value.code == 0x0609_0030
    assert await controller.read_parameters() == before


async def test_unknown_name_is_found_before_the_first_write(controller: CanopenController):
    before = await controller.parameter_checksum()
    with pytest.raises(ParameterError, match=r"leg7\.L0"):
        await controller.write_parameters({"leg1.L0": 230.0, "leg7.L0": 230.0})
    assert await controller.parameter_checksum() == before


@pytest.mark.parametrize("action", ["write", "store", "reload", "restore"])
async def test_nothing_is_changed_while_motion_is_enabled(enabled: CanopenController, action: str):
    actions = {
        "write": lambda: enabled.write_parameters({"leg1.L0": 230.7}),
        "store": enabled.store_parameters,
        "reload": enabled.reload_parameters,
        "restore": enabled.restore_default_parameters,
    }
    with pytest.raises(Refused, match="Disable motion first") as refused:
        await actions[action]()
    assert refused.value.code == 0x0800_0022


@pytest.mark.parametrize(
    ("fault", "words"),
    [
        ("parameter-missing:leg4.P_y", "53 of 54"),
        ("parameter-nan:leg4.P_y", r"nan for leg4\.P_y"),
    ],
)
async def test_incomplete_or_broken_parameters_are_named(
    station, controller: CanopenController, fault: str, words: str
):
    station.hands("fault", name=fault)
    with pytest.raises(ParameterError, match=words):
        await controller.read_parameters()


async def test_write_that_does_not_take_effect_is_noticed(station, controller: CanopenController):
    station.hands("fault", name="write-lost:leg5.B_z")
    with pytest.raises(ParameterError, match=r"leg5\.B_z"):
        await controller.write_parameters({"leg4.B_z": 0.1, "leg5.B_z": 0.1})


@pytest.mark.long
async def test_write_that_breaks_off_can_be_undone(station, controller: CanopenController):
    snapshot = await controller.read_parameters()
    station.hands("fault", name="write-refused:leg4.L0")
    changed = {name: value + 0.01 for name, value in snapshot.items() if name.endswith("L0")}
    with pytest.raises(Refused, match=r"leg4\.L0"):
        await controller.write_parameters(changed)
    half = await controller.read_parameters()
    assert half["leg3.L0"] != snapshot["leg3.L0"]
    station.hands("clear")
    await controller.write_parameters(snapshot)
    assert await controller.read_parameters() == snapshot


async def test_power_cycle_keeps_what_is_stored_and_loses_the_rest(
    station, controller: CanopenController
):
    await controller.write_parameters({"leg1.L0": 230.5, "backlash.leg1": 0.02})
    await controller.store_parameters()
    await controller.write_parameters({"leg1.L0": 230.9})
    station.power_cycle()
    held = await controller.read_parameters()
    assert (held["leg1.L0"], held["backlash.leg1"]) == (230.5, 0.02)


async def test_reload_brings_the_stored_set_back(controller: CanopenController):
    await controller.write_parameters({"leg1.L0": 230.5})
    await controller.store_parameters()
    stored = await controller.read_parameters()
    await controller.write_parameters({"leg1.L0": 230.9, "leg2.P_x": 31.1})
    await controller.reload_parameters()
    assert await controller.read_parameters() == stored


async def test_restored_defaults_count_from_the_next_start(station, controller: CanopenController):
    defaults = await controller.read_parameters()
    await controller.write_parameters({"leg1.L0": 230.5})
    await controller.store_parameters()
    await controller.restore_default_parameters()
    assert (await controller.read_parameters())["leg1.L0"] == 230.5
    station.power_cycle()
    assert await controller.read_parameters() == defaults


async def test_refused_store_leaves_the_stored_set_as_it_was(
    station, controller: CanopenController
):
    await controller.write_parameters({"leg1.L0": 230.5})
    station.hands("fault", name="store-refused")
    with pytest.raises(Refused, match="0x08000020") as refused:
        await controller.store_parameters()
    assert refused.value.code == 0x0800_0020
    await controller.reload_parameters()
    assert (await controller.read_parameters())["leg1.L0"] == 230.715


@pytest.mark.parametrize("index", [at.STORE, at.RESTORE, at.RELOAD])
async def test_wrong_signature_is_refused(controller: CanopenController, index: int):
    device = controller._bus.controller
    with pytest.raises(Refused) as refused:
        await device.call(lambda: device.download(index, 1, b"evas"))
    assert refused.value.code == 0x0800_0020


@pytest.mark.parametrize("damage", ["truncated", "one digit"])
async def test_damaged_memory_boots_with_defaults_and_says_so(
    station, connected, damage: str, tmp_path: Path
):
    controller = connected.controller
    await controller.write_parameters({"leg1.L0": 230.5})
    await controller.store_parameters()
    text = station.nvm.read_text()
    station.nvm.write_text(
        text[:-40] if damage == "truncated" else text.replace("0x1.cd", "0x1.ce", 1)
    )
    station.power_cycle()
    assert (await controller.read_parameters())["leg1.L0"] == 230.715
    assert any("non-volatile memory damaged" in alarm.what for alarm in connected.alarms)
