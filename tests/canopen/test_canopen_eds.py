"""EDS files, their documentation, and the machine files that they follow from."""

from pathlib import Path

import canopen
import pytest

from drivers.canopen.eds import EDS_FOLDER, eds_path
from drivers.canopen.layout import read_layout
from drivers.errors import DeviceError
from mocks.canopen.describe import controller_tables, drive_table
from mocks.canopen.make_eds import controller_eds, shipped_eds
from mocks.physics.truth import machine_file, nominal_parameters

DOCUMENT = Path(__file__).parents[2] / "docs" / "protocols" / "canopen.md"


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
    od = canopen.import_od(str(eds_path("hexapod_controller")), 10)
    layout = read_layout(eds_path("hexapod_controller"), 10)
    defaults = {name: od[index][sub].default for name, (index, sub) in layout.kinematic.items()}
    assert defaults == nominal_parameters(machine_file("hexapod"))


def test_own_objects_are_in_the_manufacturer_s_area_and_pdos_fit():
    for name in (Path(name).stem for name, _ in shipped_eds()):
        od = canopen.import_od(str(eds_path(name)), 10)
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
        od = canopen.import_od(str(eds_path(name)), node)
        for index in od:
            if 0x1400 <= index < 0x1600 or 0x1800 <= index < 0x1A00:
                identifiers += [od[index][1].default]
    assert len(set(identifiers)) == len(identifiers)


def test_document_s_tables_are_those_of_the_files():
    text = DOCUMENT.read_text(encoding="utf-8")
    for table in (*controller_tables(), drive_table()):
        assert table in text


def test_unknown_eds_file_names_the_known_ones():
    with pytest.raises(DeviceError, match="drive402, hexapod_controller, ptm_controller"):
        eds_path("pentapod")
