"""Effects that are not of the program are fitted again wherever their names came from."""

from pathlib import Path

import pytest

import pkmcal
from app.tui.analysis import OwnEffects, identify
from calib.errors import BadInput

RUN = str(Path(__file__).parent.parent / "data" / "runs" / "no-effect")
EFFECT = """
[effect]
id = "ours"
says = "actuators err by their own square"
acts_on = "actuator"
expression = "a * s ** 2"
unknowns = { a = "1/mm" }
"""


@pytest.mark.parametrize("held_by", ["site", "model"])
def test_an_effect_of_the_lab_s_own_is_fitted_again_by_its_name(
    tmp_path: Path, held_by: str
) -> None:
    own = tmp_path / "ours.toml"
    own.write_text(EFFECT, encoding="utf-8")
    known = OwnEffects(offers=(own,))
    if held_by == "model":
        model = tmp_path / "model.toml"
        pkmcal.fit(RUN, add=[str(own)]).save(model)
        known = OwnEffects(model=model)
    again = identify((RUN,), ("ours",), (), known)
    assert again.effects == ("ours",)
    with pytest.raises(BadInput, match="ours"):
        identify((RUN,), ("ours",), (), OwnEffects())


def test_a_fault_in_a_model_s_own_effect_names_the_effect(tmp_path: Path) -> None:
    own, model = tmp_path / "ours.toml", tmp_path / "model.toml"
    own.write_text(EFFECT, encoding="utf-8")
    pkmcal.fit(RUN, add=[str(own)]).save(model)
    text = model.read_text(encoding="utf-8")
    model.write_text(text.replace("a * s ** 2", "a * (s"), encoding="utf-8")
    with pytest.raises(BadInput) as wrong:
        identify((RUN,), ("ours",), (), OwnEffects(model=model))
    assert "own_effects.ours" in str(wrong.value)
