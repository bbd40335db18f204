"""Tables that people write for the mocks: from any editor, with their faults named."""

from pathlib import Path

import pytest

from mocks.arguments import parser
from mocks.hands import address_of
from mocks.hidden.table import Hidden
from mocks.physics.truth import machine_file, read_parameters
from mocks.station import hidden_of

HEXAPOD = machine_file("hexapod")


def written(folder: Path, name: str, text: str) -> Path:
    path = folder / name
    path.write_bytes(text.encode("utf-8"))
    return path


@pytest.mark.parametrize(
    ("name", "text"),
    [
        ("t.toml", '\ufeff[parameters]\r\n"leg1.L0" = 230.8\r\n'),
        ("t.toml", "leg1.L0 = 230.8\n"),
        ("t.json", '{"parameters": {"leg1.L0": 230.8}}'),
    ],
)
def test_parameters_are_read_in_any_form(tmp_path: Path, name: str, text: str) -> None:
    found = read_parameters(written(tmp_path, name, text), HEXAPOD)
    assert found["leg1.L0"] == 230.8
    assert found["leg2.L0"] == 230.715


def test_hidden_effects_are_read_in_any_form(tmp_path: Path) -> None:
    path = written(tmp_path, "h.toml", "\ufeff[hidden]\r\nbacklash.leg3 = 0.02\r\n")
    assert Hidden.read(path).values == {"backlash.leg3": 0.02}


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("t.toml", '"leg1.L0" = 230.8\n"leg2.L0" =\n', r"t\.toml, line 2"),
        ("t.toml", "leg9.L0 = 1.0", 'no parameter "leg9.L0"'),
        ("t.toml", "leg1.L0 = true", 'parameter "leg1.L0" must be a number'),
        ("t.json", "[1, 2]", "a table of names and numbers"),
        ("t.json", "{", r"t\.json"),
    ],
)
def test_a_fault_is_named(tmp_path: Path, name: str, text: str, says: str) -> None:
    with pytest.raises(ValueError, match=says):
        read_parameters(written(tmp_path, name, text), HEXAPOD)


def test_hidden_effects_that_are_no_table_are_refused(tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="must be a table"):
        Hidden.read(written(tmp_path, "h.toml", "hidden = 3\n"))


def test_a_site_names_the_socket_of_its_mock(tmp_path: Path) -> None:
    site = written(tmp_path, "site.toml", '\ufeff[hands]\r\ncontrol = "127.0.0.1:9"\r\n')
    assert address_of(str(site)) == "127.0.0.1:9"
    with pytest.raises(ValueError, match="no mock's control socket"):
        address_of(str(written(tmp_path, "other.toml", "hands = 3\n")))


def test_hidden_effects_of_the_command_line_stand_over_those_of_the_file(tmp_path: Path) -> None:
    path = written(tmp_path, "h.toml", '[hidden]\n"backlash.leg3" = 0.02\n"backlash.leg1" = 0.01\n')
    told = ["hexapod", "--hidden", str(path), "--effect", "backlash.leg3=0.03"]
    options = parser().parse_args([*told, "--effect", "screw-twist.L=2"])
    wanted = {"backlash.leg1": 0.01, "backlash.leg3": 0.03, "screw-twist.L": 2.0}
    assert hidden_of(options).values == wanted
    for wrong in ("backlash.leg3", "backlash.leg3=far"):
        with pytest.raises(SystemExit) as ended:
            parser().parse_args([*told[:1], "--effect", wrong])
        assert ended.value.code == 2
