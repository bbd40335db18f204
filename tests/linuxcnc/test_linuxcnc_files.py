"""LinuxCNC's files and pins, without LinuxCNC."""

import math
from pathlib import Path

import numpy as np
import pytest
from linuxcnc_bench import MACHINE, NOMINAL, STRUTS, lengths_at, places, some_poses

from app.machine_templates.linuxcnc import linuxcnc_file
from calib.effects.struts import struts_of
from calib.errors import BadInput
from calib.mechanism.check import require_sound
from calib.mechanism.parse import parse_machine
from drivers.errors import ParameterError, Refused
from drivers.linuxcnc.configuration import Ini, with_entries, with_pins, write_surely
from drivers.linuxcnc.places import LEAD, Places
from drivers.linuxcnc.rotation import matrix
from drivers.linuxcnc.stored import Stored
from mocks.linuxcnc.configuration import write_configuration

NORMALS = [(strut.base_normal, strut.platform_normal) for strut in STRUTS]


def pins_of(values: dict[str, float]) -> dict[str, float]:
    nothing = dict.fromkeys(places().pins, 0.0)
    return nothing | places().to_pins(values, nothing)


def drawn(seed: int) -> dict[str, float]:
    generator = np.random.default_rng(seed)
    values = {name: value + generator.uniform(-0.3, 0.3) for name, value in NOMINAL.items()}
    values |= {f"backlash.leg{n}": abs(generator.normal(0.0, 0.01)) for n in range(1, 7)}
    return values | {"screw-twist.L": generator.uniform(-4.0, 4.0)}


@pytest.mark.parametrize("seed", range(20))
def test_parameters_come_back_from_their_pins_bit_for_bit(seed: int) -> None:
    values = drawn(seed)
    assert places().parameters(pins_of(values)) == values


@pytest.mark.parametrize("seed", range(5))
def test_lengths_by_the_pins_are_those_of_the_engine(seed: int) -> None:
    values = drawn(seed)
    for pose in some_poses(5, seed):
        found = places().lengths(pins_of(values), pose[:3], matrix(*pose[3:]))
        assert np.abs(found - lengths_at(pose, values)).max() < 1e-9


def test_the_turn_of_the_screws_at_home_goes_into_the_home_offset() -> None:
    pins = pins_of({**drawn(1), "screw-twist.L": 2.0, "leg1.L0": 240.0})
    assert pins[LEAD] == -2.0
    turned = -2.0 * STRUTS[0].home_turn / (2.0 * math.pi)
    assert pins["ini.0.home_offset"] == pytest.approx(240.0 + turned, abs=2e-9)


def test_an_l0_that_would_lose_its_last_bit_is_refused() -> None:
    at_a_power_of_two = math.nextafter(256.0, 0.0)
    with pytest.raises(ParameterError, match="last bit"):
        pins_of({**drawn(1), "screw-twist.L": -2.0, "leg1.L0": at_a_power_of_two})


def test_machines_that_genhexkins_cannot_hold_are_refused() -> None:
    with pytest.raises(Refused, match=r"no place for leg1\.L_B"):
        Places.of((*NOMINAL, "leg1.L_B"), STRUTS)
    turned = STRUTS[0].__class__(**{**vars(STRUTS[0]), "home_turn": 1.7})
    with pytest.raises(Refused, match="cross axes of leg1"):
        Places.of(tuple(NOMINAL), (turned, *STRUTS[1:]))


def test_rewritten_files_keep_every_other_line() -> None:
    ini = "[JOINT_0]\n# a note\nHOME = 1.0\nTYPE = LINEAR\n[JOINT_1]\nHOME = 2.0\n"
    text = with_entries(ini, {("JOINT_0", "HOME"): 0.1 + 0.2, ("JOINT_1", "BACKLASH"): 0.5})
    assert text == (
        "[JOINT_0]\n# a note\nHOME = 0.30000000000000004\nTYPE = LINEAR\n"
        "[JOINT_1]\nBACKLASH = 0.5\nHOME = 2.0\n"
    )
    with pytest.raises(ParameterError, match="JOINT_7"):
        with_entries(ini, {("JOINT_7", "HOME"): 1.0})
    hal = "loadrt genhexkins\n  setp genhexkins.base.0.x [BASE]X # drawn\n"
    assert with_pins(hal, {"genhexkins.base.0.x": 1.5, "b": 2.0}) == (
        "loadrt genhexkins\n  setp genhexkins.base.0.x 1.5 # drawn\nsetp b 2.0\n"
    )


def test_the_old_file_stays_beside_the_new_one(tmp_path: Path) -> None:
    path = tmp_path / "a.hal"
    path.write_text("one", encoding="utf-8")
    for text in ("two", "three"):
        write_surely(path, text)
    assert path.read_text(encoding="utf-8") == "three"
    kept = sorted(tmp_path.glob("*.before"))
    assert [one.read_text(encoding="utf-8") for one in kept] == ["one", "two"]
    assert not list(tmp_path.glob("*.draft"))


def test_what_is_stored_is_what_would_be_loaded(tmp_path: Path) -> None:
    ini = write_configuration(tmp_path, NOMINAL, NORMALS, "7")
    stored = Stored.of({"ini": str(ini), "hal": ""}, places())
    assert places().parameters(stored.pins(pins_of(drawn(2)))).items() >= NOMINAL.items()
    values = drawn(3)
    stored.write(pins_of(values))
    again = Stored.of({"ini": str(ini), "hal": ""}, places())
    assert places().parameters(again.pins(dict.fromkeys(places().pins, 0.0))) == values


@pytest.mark.parametrize(
    ("homing", "refused"),
    [
        ("HOME_SEARCH_VEL = 20\nHOME_LATCH_VEL = 2", False),
        ("HOME_SEARCH_VEL = 0\nHOME_LATCH_VEL = 2\nHOME_USE_INDEX = YES", False),
        ("HOME_LATCH_VEL = -2.0\nHOME_USE_INDEX = yes # every turn", False),
        ("HOME_SEARCH_VEL = 0\nHOME_LATCH_VEL = 2\nHOME_USE_INDEX = NO", True),
        ("HOME_SEARCH_VEL = 0\nHOME_LATCH_VEL = 0\nHOME_USE_INDEX = YES", True),
        ("HOME_SEARCH_VEL = 20\nHOME_LATCH_VEL = 2\nHOME_ABSOLUTE_ENCODER = 1", True),
    ],
)
def test_joints_without_a_reference_of_their_own_are_refused(
    tmp_path: Path, homing: str, refused: bool
) -> None:
    ini = write_configuration(tmp_path, NOMINAL, NORMALS, "7")
    others = [line for line in ini.read_text().splitlines() if not line.startswith("HOME_")]
    head = others.index("[JOINT_0]")
    texts = [line + (f"\n{homing}" if line.startswith("[JOINT_") else "") for line in others]
    assert texts[head] == f"[JOINT_0]\n{homing}"
    ini.write_text("\n".join(texts) + "\n")
    stored = Stored.of({"ini": str(ini), "hal": ""}, places())
    state = {"ini": str(ini), "joints": [0.0] * 6, "mm": 1.0, "degrees": 1.0}
    if not refused:
        stored.check(state)
        return
    with pytest.raises(Refused, match="wherever it stands"):
        stored.check(state)


class Answers:
    """Answers to a template's questions: the INI file, and what is proposed otherwise."""

    def __init__(self, ini: Path) -> None:
        self.ini = ini

    def number(self, name: str, question: str, default: float) -> float:
        return default

    def text(self, name: str, question: str, default: str) -> str:
        return str(self.ini)


def test_a_machine_file_from_an_ini_file_is_the_machine_of_its_pins(tmp_path: Path) -> None:
    # Normals that stand aslant, as genhexkins begins with.
    aslant = [((0.8 * b[0], 0.8 * b[1], 0.6), p) for b, p in NORMALS]
    values = {name: round(value, 6) for name, value in drawn(4).items()}
    ini = write_configuration(tmp_path, values, aslant, "7")
    text = linuxcnc_file("lab", Answers(ini))
    machine = parse_machine(text, "lab.toml")
    require_sound(machine, text)
    assert {p.name: p.nominal for p in machine.parameters} == pytest.approx(
        {p.name: values[p.name] for p in MACHINE.parameters}, abs=1e-9
    )
    for strut, (base, platform) in zip(struts_of(machine), aslant, strict=True):
        assert strut.base_normal == pytest.approx(base, abs=1e-9)
        assert strut.platform_normal == pytest.approx(platform, abs=1e-9)


def test_an_ini_file_without_the_geometry_is_refused_in_words(tmp_path: Path) -> None:
    ini = write_configuration(tmp_path, NOMINAL, NORMALS, "7")
    (tmp_path / "hexapod.hal").write_text("loadrt genhexkins\n", encoding="utf-8")
    with pytest.raises(BadInput, match=r"genhexkins\.base\.0\.x"):
        linuxcnc_file("lab", Answers(ini))
    with pytest.raises(Refused, match=r"sets genhexkins\.base\.0\.x"):
        Stored.of({"ini": str(ini), "hal": ""}, places())
    with pytest.raises(Refused, match="cannot be read"):
        Ini.read(tmp_path / "none.ini")
