"""A model file is read by one reader whatever verb reads it, and its faults have a line."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
import tomli_w

from app.files.fits import parse_fit, read_fit
from app.files.machines import load_machine
from app.files.models import chosen_effects
from app.files.staircase import StairStep, Way, way_tables
from calib.errors import BadInput

OWN = """[effect]
id = "warming"
expression = "k * t"
unknowns = { k = "mm/s" }
"""
MODEL = f"""format = "pkm-model/1"
machine = "hexapod"
effects = ["backlash", "warming"]

[own_effects]
warming = '''
{OWN}'''

[compensation]
"backlash.leg1" = 0.01

[quality]
chi2_per_dof = 1.1

[[parameters]]
name = "leg1.L0"
value = 230.6
sigma = 0.05
unit = "mm"

[[parameters]]
name = "leg1.B_x"
value = 173.9
sigma = 0.1
unit = "mm"
identified = false

[correlations]
"leg1.L0" = [1.0]
"leg1.B_x" = [0.5, 1.0]
"""


def test_what_a_model_file_says() -> None:
    fit = parse_fit(MODEL, "m.toml")
    assert (fit.machine, fit.effects) == ("hexapod", ("backlash", "warming"))
    assert fit.estimates["leg1.B_x"].identified is False
    assert fit.quality["chi2_per_dof"] == 1.1
    assert fit.compensation == {"backlash.leg1": 0.01}
    np.testing.assert_allclose(fit.covariance, [[0.0025, 0.0025], [0.0025, 0.01]])


def test_the_effects_of_a_model_file_are_those_of_the_next_fit(tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    path.write_text("\ufeff" + MODEL.replace("\n", "\r\n"), encoding="utf-8", newline="")
    chosen = chosen_effects(load_machine("hexapod"), ("settling", "backlash"), path)
    assert [effect.id for effect in chosen] == ["backlash", "warming", "settling"]
    assert read_fit(path).own == {"warming": OWN}


def test_the_answer_of_fit_is_a_model_file_without_correlations(tmp_path: Path) -> None:
    path = tmp_path / "fit.json"
    entry = {"name": "leg1.L0", "value": 230.6, "sigma": None, "unit": "mm"}
    fit = {"format": "pkm-fit/1", "effects": ["backlash"], "chi2_per_dof": 1.0, "rms_um": None}
    path.write_text(json.dumps({**fit, "parameters": [entry]}))
    saved = read_fit(path)
    assert saved.quality == {"chi2_per_dof": 1.0}
    assert (saved.correlated, saved.compensation) == (False, None)
    assert np.isnan(saved.estimates["leg1.L0"].sigma)
    assert [e.id for e in chosen_effects(load_machine("hexapod"), (), path)] == ["backlash"]


def test_effects_alone_are_a_model_file(tmp_path: Path) -> None:
    path = tmp_path / "by-hand.toml"
    path.write_text('format = "pkm-model/1"\neffects = ["backlash"]\n')
    assert [e.id for e in chosen_effects(load_machine("hexapod"), (), path)] == ["backlash"]


@pytest.mark.parametrize(
    ("old", "new", "line", "what"),
    [
        ("pkm-model/1", "pkm-model/9", 1, "pkm-model/9"),
        ('["backlash", "warming"]', '"backlash"', 3, "effects is 'backlash'"),
        ("value = 230.6", 'value = "long"', 21, "value is 'long'"),
        ("sigma = 0.1", "sigma = true", 28, "sigma is True"),
        ('name = "leg1.B_x"', "", 25, "name is missing"),
        ('name = "leg1.B_x"', 'name = "leg1.L0"', 26, "twice"),
        ("identified = false", "identified = 0", 30, "identified is 0"),
        ("[0.5, 1.0]", "[0.5]", 34, "2 finite numbers"),
        ('"backlash.leg1" = 0.01', '"backlash.leg1" = "much"', 14, "much"),
        ("warming = '''", "warming = 7 #'''", 6, "TOML"),
    ],
)  # fmt: skip
def test_a_fault_is_named_with_its_line(old: str, new: str, line: int, what: str) -> None:
    assert old in MODEL
    with pytest.raises(BadInput) as wrong:
        parse_fit(MODEL.replace(old, new, 1), "m.toml")
    assert what in str(wrong.value)
    if what != "TOML":
        assert f"{wrong.value.place},".startswith(f"m.toml, line {line},")


@pytest.mark.parametrize("text", ["{", '{"format": 3}', "{}", "", "[" * 100_000, "{" * 3000])
def test_what_is_no_model_file_ends_in_words(text: str) -> None:
    with pytest.raises(BadInput, match=r"m\.toml"):
        parse_fit(text, "m.toml")


def test_the_way_to_a_model_goes_round() -> None:
    steps = (
        StairStep(did="start", rms_um=14.2),
        StairStep(did="+ backlash", rms_um=8.9, p_value=1e-12, rivals=("hysteresis",)),
    )
    way = Way(steps, (("gravity-sag", "leg-compliance"),))
    text = tomli_w.dumps({**tomllib.loads(MODEL), **way_tables(way)})
    assert parse_fit(text, "model.toml").way == way
    assert parse_fit(MODEL, "model.toml").way == Way()
