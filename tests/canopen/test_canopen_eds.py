"""EDS files, their documentation, and the machine files that they follow from."""

import subprocess
import sys
import warnings
from pathlib import Path

import dcf
import pytest

import calib
from app.cli import run
from drivers.canopen.eds import EDS_FOLDER, dictionary, eds_path
from drivers.canopen.kind import KIND
from drivers.canopen.layout import read_layout
from drivers.errors import DeviceError, Refused
from drivers.kind import ActuatorFacts, Surroundings
from mocks.canopen.describe import controller_tables, drive_table
from mocks.canopen.make_eds import controller_eds, shipped_eds
from mocks.physics.truth import machine_file, nominal_parameters

DOCUMENT = Path(__file__).parents[2] / "docs" / "protocols" / "canopen.md"
DRIVE = eds_path("drive402").read_text(encoding="utf-8")
MACHINES = sorted(path.stem for path in Path(calib.__file__).parent.glob("machines/*.toml"))


def test_shipped_files_follow_from_the_machine_file():
    for name, text in shipped_eds():
        assert (EDS_FOLDER / name).read_text(encoding="utf-8") == text


@pytest.mark.parametrize(("machine", "count"), [("hexapod", 54), ("ptm", 83)])
def test_layout_of_any_machine_is_read_from_its_file(machine: str, count: int, tmp_path: Path):
    described = machine_file(machine)
    name, text = controller_eds(described)
    (tmp_path / name).write_text(text, encoding="utf-8")
    layout = read_layout(tmp_path / name, 10)
    assert list(layout.kinematic) == [p.name for p in described.parameters]
    assert len(layout.kinematic) == count
    assert layout.actuators == tuple(a.name for a in described.actuators)
    assert layout.pose == described.task.coordinates
    assert len(layout.compensation) == len(described.actuators) * (2 + 33)


def test_defaults_are_the_nominal_values():
    od = dictionary(eds_path("hexapod_controller"), 10)
    layout = read_layout(eds_path("hexapod_controller"), 10)
    defaults = {name: od[index][sub].default for name, (index, sub) in layout.kinematic.items()}
    assert defaults == nominal_parameters(machine_file("hexapod"))


def test_own_objects_are_in_the_manufacturer_s_area_and_pdos_fit():
    for name in (Path(name).stem for name, _ in shipped_eds()):
        od = dictionary(eds_path(name), 10)
        for index in od:
            assert 0x1000 <= index < 0x2000 or 0x2000 <= index < 0x6000 or 0x6000 <= index < 0xA000
            if 0x1600 <= index < 0x1800 or 0x1A00 <= index < 0x1C00:
                mapped = [od[index][sub].default for sub in range(1, len(od[index]))]
                assert sum(entry & 0xFF for entry in mapped) <= 64
                for entry in mapped:
                    variable = od.get_variable(entry >> 16, entry >> 8 & 0xFF)
                    assert variable.pdo_mappable
                    assert len(variable) == entry & 0xFF


def test_no_two_pdos_share_an_identifier():
    identifiers = []
    for node, name in [(n, "drive402") for n in range(1, 7)] + [(10, "hexapod_controller")]:
        od = dictionary(eds_path(name), node)
        for index in od:
            if 0x1400 <= index < 0x1600 or 0x1800 <= index < 0x1A00:
                identifiers += [od[index][1].default]
    assert len(set(identifiers)) == len(identifiers)


def test_document_s_tables_are_those_of_the_files():
    text = DOCUMENT.read_text(encoding="utf-8")
    for table in (*controller_tables(), drive_table()):
        assert table in text


@pytest.mark.parametrize("name", [name for name, _ in shipped_eds()])
def test_shipped_files_pass_the_foreign_checker_without_a_word(name: str):
    checker = Path(sys.executable).with_name("dcfchk")
    said = subprocess.run(
        [checker, "-n", "10", EDS_FOLDER / name], capture_output=True, text=True, timeout=60
    )
    assert (said.returncode, said.stdout, said.stderr) == (0, "", "")


@pytest.mark.parametrize("name", MACHINES)
def test_any_machine_s_file_passes_the_foreign_checker_and_is_read_back(name: str, tmp_path: Path):
    path = tmp_path / "controller.eds"
    assert run(["machine", "eds", name, "--out", str(path)]) == 0
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = dcf.parse_file(str(path))
        assert dcf.lint(found)
        device = dcf.Device(found, {"NODEID": 10})
    machine = machine_file(name)
    layout = read_layout(path, 10)
    ours = dictionary(path, 10)
    assert sorted(layout.kinematic) == sorted(p.name for p in machine.parameters)
    for parameter in machine.parameters:
        index, sub = layout.kinematic[parameter.name]
        assert ours[index][sub].default == parameter.nominal
        assert device[index][sub].parse_value() == parameter.nominal  # as the foreign tool reads


def test_a_file_is_not_written_over_unasked(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    path = tmp_path / "own.eds"
    path.write_text("mine", encoding="utf-8")
    assert run(["machine", "eds", "tripod", "--out", str(path)]) == 2
    assert "--force" in capsys.readouterr().err
    assert path.read_text(encoding="utf-8") == "mine"
    assert run(["machine", "eds", "tripod", "--out", str(path), "--force"]) == 0


@pytest.mark.parametrize("text", ["", "[1018]\n", "nonsense", "\x00\xff", DRIVE])
def test_a_file_that_is_no_controller_s_is_said_to_be_none(text: str, tmp_path: Path):
    path = tmp_path / "drive.eds"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(DeviceError, match="is no EDS file of a kinematic controller"):
        read_layout(path, 10)


@pytest.mark.parametrize("change", [("leg1.B_x", "leg1.B_q"), ("=hexapod", "=mine")])
async def test_a_file_of_another_machine_is_refused_before_anything_is_opened(
    change: tuple[str, str], tmp_path: Path
):
    path = tmp_path / "other.eds"
    text = eds_path("hexapod_controller").read_text(encoding="utf-8")
    path.write_text(text.replace(*change), encoding="utf-8")
    machine = machine_file("hexapod")
    given = {"channel": "socket://127.0.0.1:9", "eds": str(path)}
    around = Surroundings(
        settings={s.name: given.get(s.name, s.default) for s in KIND.settings},
        serial="",
        machine=machine.name,
        actuators=tuple(ActuatorFacts(a.name, a.unit, a.home, a.limits) for a in machine.actuators),
        parameters=nominal_parameters(machine),
    )
    with pytest.raises(Refused, match=change[1].strip("=")):
        await KIND.open(around)


def test_unknown_eds_file_names_the_known_ones():
    with pytest.raises(DeviceError, match="drive402, hexapod_controller, ptm_controller"):
        eds_path("pentapod")
