"""What a machine file lacks is found by rank, whatever was taken out of it."""

import re
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

import pkmcal
from calib.analysis.lacking import lacking
from calib.errors import BadInput


def shipped(name: str) -> str:
    return (resources.files("calib.machines") / f"{name}.toml").read_text(encoding="utf-8")


def test_the_offsets_of_universal_joints_are_what_the_incomplete_hexapod_lacks() -> None:
    found = pkmcal.complete("hexapod-universal")
    assert [(one.element, one.joint) for one in found.lacking] == [("ty", 5), ("ty", 1)]
    assert found.rank_after - found.rank_before == 12


def test_nothing_is_lacking_of_six_struts_with_ball_joints() -> None:
    assert pkmcal.complete("stewart").lacking == ()


@pytest.mark.parametrize("gone", ["a2", "b3", "skew3", "d5"])
def test_what_was_taken_out_of_the_arm_is_found(tmp_path: Path, gone: str) -> None:
    text = shipped("arm")
    nominal = re.search(rf"^{gone} = .*nominal = ([\d.]+)", text, re.MULTILINE)
    assert nominal is not None
    text = re.sub(rf"^{gone} = .*\n", "", text, flags=re.MULTILINE)
    text = text.replace(f":{gone}", f":{nominal[1]}").replace(f' "{gone}",', "")
    (tmp_path / "less.toml").write_text(text.replace('name = "arm"', 'name = "less"'))
    found = pkmcal.complete(tmp_path / "less.toml")
    (one,) = [each for each in found.lacking if not each.tool]
    assert one.unit == ("rad" if gone == "skew3" else "mm")
    (tmp_path / "more.toml").write_text(found.text)
    again = pkmcal.complete(tmp_path / "more.toml")
    assert [each for each in again.lacking if not each.tool] == []
    assert again.rank_before == found.rank_before + 1
    assert "# Upper arm upright" in found.text


def test_errors_of_the_tool_are_told_apart_and_proposed_if_asked() -> None:
    plain = pkmcal.complete("arm")
    assert [one.tool for one in plain.lacking] == [True] * 5
    assert plain.proposal == ""
    whole = pkmcal.complete("arm", tool=True)
    assert whole.rank_after == 24
    assert all(f":{one.name}" in whole.proposal for one in whole.lacking)


def test_a_file_that_cannot_be_read_is_named(tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="unknown machine"):
        pkmcal.complete(tmp_path / "none.toml")


def test_candidates_are_taken_until_the_rest_is_imitated() -> None:
    rng = np.random.default_rng(4)
    known, frame, new = (rng.standard_normal((k, 40)) for k in (3, 2, 2))
    imitated = 0.5 * known[:1] + frame[1:]
    found = lacking(known, frame, [imitated, new[:1], new[1:], new[:1] + imitated], [True] * 4)
    assert found.rank_before == 3
    assert found.rank_after == 5
    assert len(found.chosen) == 2
    assert 0 not in found.chosen
