"""Faults in a machine file are named with file, line and remedy."""

import re
from importlib.resources import files

import numpy as np
import pytest

from calib.errors import BadInput
from calib.mechanism.parse import parse_machine
from calib.toml_faults import ManyFaults

TEXT = files("calib.machines").joinpath("hexapod.toml").read_text()


def fault(old: str, new: str) -> BadInput:
    """What is told first of a spoilt file."""
    assert old in TEXT
    with pytest.raises(BadInput) as caught:
        parse_machine(TEXT.replace(old, new, 1), "mine.toml")
    return caught.value.faults[0] if isinstance(caught.value, ManyFaults) else caught.value


def line_with(text: str, part: str) -> int:
    return next(i for i, line in enumerate(text.splitlines(), 1) if part in line)


@pytest.mark.parametrize(
    ("old", "new", "says", "remedy"),
    [
        ('name = "hexapod"', 'nmae = "hexapod"', 'unknown key "nmae"', 'Did you mean "name"?'),
        ('"pkm-machine/1"', '"pkm-machine/9"', "format is", "pkm-machine/1"),
        ('rx = ["-15 deg"', 'rx = ["-15 degree"', 'unknown unit "degree"', "deg"),
        ('rx = ["-15 deg"', 'rx = ["15 deg"', "lower limit", ""),
        ('reference = "leg1.L0"', 'reference = "leg1.L9"', '"leg1.L9" is not a parameter', ""),
        ("limits = [195.0, 265.0]", "limit = [195.0, 265.0]", 'unknown key "limit"', "limits"),
        ("home = 230.715, limits", "home = 300.0, limits", "outside its limits", "wider limits"),
        ('q = "q1"', 'q = "q9"', "q9", "q1, q2"),
        ('type = "leg"', 'type = "lag"', 'limb type "lag"', "leg"),
        ("B_x = 173.866648732032", "B_xx = 173.87", "no nominal value", "limb"),
        ("tolerance = 0.3, says", "tolerance = -0.3, says", "no positive tolerance", "sigma"),
        ('unit = "mm", tolerance = 0.05', 'unit = "inch", tolerance = 0.05', "inch", "mm or rad"),
    ],
)
def test_faults_are_named(old: str, new: str, says: str, remedy: str) -> None:
    caught = fault(old, new)
    assert says in caught.what
    assert remedy in caught.remedy
    assert re.match(r"mine\.toml, line \d+", caught.place)


def test_the_line_is_the_line_of_the_fault() -> None:
    broken = TEXT.replace('phi_b = "105 deg"', 'phi_b = "105 dge"', 1)
    with pytest.raises(BadInput) as caught:
        parse_machine(broken, "mine.toml")
    assert "phi_b" in broken.splitlines()[line_with(broken, "105 dge") - 1]
    assert 'unknown unit "dge"' in caught.value.what


@pytest.mark.parametrize(
    ("token", "says"),
    [
        ("tq:B_x", "not an element"),
        ("tx", "has no value"),
        ("tx:B_x+", "cannot read the value"),
        ("tx:q", "fixed element but moves"),
        ("Tx:B_x", "holds no actuator"),
        ("rx:B_x", "is in mm"),
        ("Uxyz", "names 3 axes"),
        ("Rx(3mm)", "does not measure"),
        ("cty:-1", "positive number"),
        ("tx:Bx", 'Did you mean "B_x"?'),
    ],
)
def test_a_wrong_element_is_named(token: str, says: str) -> None:
    caught = fault("tx:B_x ty:B_y", f"{token} tx:B_x ty:B_y")
    assert says in str(caught)
    assert token in str(caught)
    assert "limb leg1" in str(caught)


def test_broken_toml_names_its_line() -> None:
    with pytest.raises(BadInput) as caught:
        parse_machine(TEXT.replace("[home]", "[home", 1), "mine.toml")
    assert f"line {line_with(TEXT, '[home]')}" in caught.value.place


def test_duplicate_limb_is_refused() -> None:
    with pytest.raises(BadInput, match="not valid TOML"):
        parse_machine(TEXT.replace("[limbs.leg2]", "[limbs.leg1]", 1), "mine.toml")


def test_priors_are_the_tolerance_over_root_three() -> None:
    machine = parse_machine(TEXT, "mine.toml")
    at = machine.index("leg3.P_y")
    assert machine.parameters[at].tolerance == 0.3
    assert machine.prior_sigma[at] == pytest.approx(0.3 / np.sqrt(3))
    assert [p.name for p in machine.parameters[:2]] == ["leg1.B_x", "leg1.B_y"]


def test_reference_is_what_the_controller_holds() -> None:
    machine = parse_machine(TEXT, "mine.toml")
    q = np.full((6, 1), 231.0)
    nominal = machine.extension(q)
    held = machine.extension(q, {"leg2.L0": 230.9})
    assert nominal[:, 0] == pytest.approx(np.full(6, 0.285))
    assert held[1, 0] == pytest.approx(0.1)
    assert held[0, 0] == pytest.approx(0.285)


def test_every_fault_of_a_machine_file_is_told_at_once() -> None:
    text = files("calib.machines").joinpath("stewart.toml").read_text("utf-8")
    spoilt = {
        'x = [-60.0, 60.0]': 'x = [60.0, -60.0]',
        'q2 = { unit = "mm", reference = "leg2.L0", home = 394.230682':
            'q2 = { unit = "mm", reference = "leg2.L0", home = 94.230682',
        'B_y = { unit = "mm", tolerance = 0.2': 'B_y = { unit = "mm", tolerance = 0.0',
        'screw = "turn"': 'screw = "tern"',
        'q = "q5"': 'q = "q9"',
    }  # fmt: skip
    for right, wrong in spoilt.items():
        assert text.count(right) == 1
        text = text.replace(right, wrong)
    lines = [line_with(text, wrong) for wrong in spoilt.values()]
    with pytest.raises(ManyFaults) as told:
        parse_machine(text, "spoilt.toml")
    assert len(lines) == len(spoilt)
    assert [int(re.findall(r"line (\d+)", one.place)[0]) for one in told.value.faults] == sorted(
        lines
    )
    assert "5 faults" in str(told.value)
