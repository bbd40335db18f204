"""A machine of one's own over CAN: its file, the EDS file made from it, a station, the driver."""

from pathlib import Path

import pytest

import calib
from app.cli import run
from app.files.machines import load_machine
from calib.errors import BadInput
from drivers.canopen.kind import KIND
from drivers.kind import ActuatorFacts, Surroundings
from mocks.arguments import parser
from mocks.own_files import own_files, own_machine
from mocks.physics.truth import machine_file
from mocks.station import build

SHIPPED = Path(calib.__file__).parent / "machines"


@pytest.fixture
def mine(tmp_path: Path) -> Path:
    """The hexapod with another name, longer legs and narrower limits."""
    text = (SHIPPED / "hexapod.toml").read_text(encoding="utf-8")
    for old, new in (
        ('name = "hexapod"', 'name = "mine"'),
        ("230.715", "230.9"),
        ("[195.0, 265.0]", "[200.0, 262.0]"),
    ):
        text = text.replace(old, new)
    path = tmp_path / "mine.toml"
    path.write_text(text, encoding="utf-8")
    return path


@pytest.mark.long
async def test_own_machine_is_found_with_its_own_numbers(mine: Path) -> None:
    eds = mine.with_name("mine_controller.eds")
    assert run(["machine", "eds", str(mine), "--out", str(eds)]) == 0
    station = build(parser().parse_args([str(mine), "--eds", str(eds), "--scale", "500"]))
    await station.start()
    machine = load_machine(str(mine))
    given = {"channel": station.channel, "eds": str(eds)}
    around = Surroundings(
        settings={s.name: given.get(s.name, s.default) for s in KIND.settings},
        serial="",
        machine=machine.name,
        actuators=tuple(ActuatorFacts(a.name, a.unit, a.home, a.limits) for a in machine.actuators),
        parameters={p.name: p.nominal for p in machine.parameters},
    )
    controller = await KIND.open(around)
    try:
        held = await controller.read_parameters()
        assert {name: held[name] for name in around.parameters} == around.parameters
        assert held["leg3.L0"] == 230.9
        state = await controller.state()
        assert [actuator.position for actuator in state.actuators] == [230.9] * 6
    finally:
        await controller.close()
        await station.stop()


def test_a_mechanism_without_a_mock_is_said_to_have_none(mine: Path, tmp_path: Path) -> None:
    mine.write_text(mine.read_text("utf-8").replace("psi_P=Rx(-90d)", "psi_P=Rx(-89d)"), "utf-8")
    options = parser().parse_args([str(mine), "--bare"])
    with pytest.raises(ValueError, match="no mock of this mechanism"):
        build(options)
    with pytest.raises(ValueError, match="pkmcal machine eds"):
        own_files(str(mine), None, bare=False)
    with pytest.raises(ValueError, match="there are mocks of hexapod, tripod, ptm"):
        own_files("pentapod", None, bare=False)
    other = own_files(str(SHIPPED / "ptm.toml"), SHIPPED / "ptm.toml", bare=False)
    assert other is not None
    with pytest.raises((ValueError, BadInput)):
        own_machine(other)
    assert machine_file("hexapod").name == "hexapod"  # the shipped one is as it was
