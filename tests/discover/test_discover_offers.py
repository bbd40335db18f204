"""A lab's own effects stand beside the catalogue as candidates."""

import json
from pathlib import Path

import pytest
from click.testing import CliRunner

from app.files.models import offered_effects
from app.verbs.diagnose import command
from calib.errors import BadInput

RUN = Path(__file__).parents[1] / "data" / "runs" / "backlash-leg-3"
CABLE = """
[effect]
id = "{}"
says = "a cable pulls where a leg is long"
acts_on = "actuator"
expression = "k * s**2 * direction"
unknowns = {{ k = "1/mm" }}
"""


@pytest.fixture
def cable(tmp_path: Path) -> Path:
    path = tmp_path / "cable.toml"
    path.write_text(CABLE.format("cable"), encoding="utf-8")
    return path


def test_two_files_of_one_id_are_refused_and_one_in_the_model_is_not_offered(
    cable: Path, tmp_path: Path
) -> None:
    other = tmp_path / "other.toml"
    other.write_text(CABLE.format("cable"), encoding="utf-8")
    with pytest.raises(BadInput, match="two offered effects have the id 'cable'"):
        offered_effects([cable, other])
    held = offered_effects([cable, cable])
    assert [effect.id for effect in held] == ["cable"]
    assert offered_effects([cable], held) == []


def test_what_is_offered_is_a_candidate_and_does_not_displace_the_truth(cable: Path) -> None:
    asked = CliRunner().invoke(command, [str(RUN), "--offer", str(cable), "--json"])
    assert asked.exit_code == 0
    found = json.loads(asked.stdout)
    names = [one["effect"] for one in found["candidates"]]
    assert names[0] == "backlash"
    assert "cable" in names
    assert found["baseline"]["effects"] == []
