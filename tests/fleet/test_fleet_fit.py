"""A fleet from its folders to its answer: the same again, gone on with, bad machines named."""

import json
import shutil
from pathlib import Path

import pytest

import pkmcal
from app.cli import run
from calib.errors import BadInput
from tests.fleet.fleet_made import make_fleet


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_fleet(tmp_path_factory.mktemp("antennas"), 6, m4={"backlash.limb2": 0.2})


def test_a_fleet_is_told_and_goes_on_where_it_was(
    made: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    page, kept = tmp_path / "fleet.html", tmp_path / "kept"
    words = ["fleet", "fit", str(made), "--workers", "1", "--out", str(kept)]
    assert run([*words, "--report", str(page), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert [one["name"] for one in said["machines"]] == [f"m{k}" for k in range(6)]
    assert [(one["machine"], one["what"]) for one in said["outliers"]] == [("m4", "misfit")]
    assert "m4: its readings are explained worse" in page.read_text(encoding="utf-8")
    (kept / "machines" / "m2.json").unlink()
    steps: list[tuple[int, int]] = []
    again = pkmcal.fit_fleet(
        made, out=kept, workers=1, watch=lambda done, of: steps.append((done, of))
    )
    assert steps == [(5, 6), (6, 6)]
    assert again.to_json() == said
    assert run(words) == 0
    assert "Not like the others:\n  m4: its readings" in capsys.readouterr().out


def test_a_machine_that_cannot_be_fitted_holds_up_no_other(made: Path, tmp_path: Path) -> None:
    bad = tmp_path / "bad"
    bad.mkdir()
    (bad / "run.toml").write_text((made / "m0" / "run.toml").read_text("utf-8"), "utf-8")
    table = (made / "m0" / "points.csv").read_text("utf-8").splitlines()
    (bad / "points.csv").write_text("\n".join(table[:4]) + "\n", "utf-8")
    found = pkmcal.fit_fleet([made / "m0", made / "m1", bad], workers=1)
    assert [bool(one.failed) for one in found.machines] == [False, False, True]
    assert any(remark.startswith("bad is left out") for remark in found.remarks)
    assert found.outliers == ()


def test_strays_in_the_folder_are_left_out_by_name(made: Path, tmp_path: Path) -> None:
    for name in ("m0", "m1"):
        shutil.copytree(made / name, tmp_path / "hall" / name)
    pkmcal.simulate("hexapod", tmp_path / "hall" / "h1", poses=3)
    (tmp_path / "hall" / "photos").mkdir()
    (tmp_path / "hall" / "cut").mkdir()
    shutil.copy(made / "m2" / "run.toml", tmp_path / "hall" / "cut")
    table = (made / "m2" / "points.csv").read_text("utf-8")
    (tmp_path / "hall" / "cut" / "points.csv").write_text(table[: len(table) // 2], "utf-8")
    out = tmp_path / "hall" / "kept"
    found = pkmcal.fit_fleet(tmp_path / "hall", out=out, workers=1)
    assert [one.name for one in found.machines if not one.failed] == ["m0", "m1"]
    remarks = " / ".join(found.remarks)
    assert "h1 is left out: a hexapod, but" in remarks
    assert "cut is left out: " in remarks
    assert "truncated" in remarks
    assert "photos: no run lies in it" in remarks
    assert "kept" not in remarks
    for number, text in enumerate(("[]", "{", '{"format": "pkm-fleet-machine/1"}')):
        (out / "machines" / f"m{number % 2}.json").write_text(text, "utf-8")
        assert pkmcal.fit_fleet(tmp_path / "hall", out=out, workers=1).to_json() == found.to_json()


def test_what_is_no_fleet_is_said(made: Path, tmp_path: Path) -> None:
    with pytest.raises(BadInput, match="one machine is no fleet"):
        pkmcal.fit_fleet(made / "m0")
    with pytest.raises(BadInput, match="no run lies in it"):
        pkmcal.fit_fleet(tmp_path)
    pkmcal.simulate("hexapod", tmp_path / "other", poses=3)
    with pytest.raises(BadInput, match="as many of both"):
        pkmcal.fit_fleet([made / "m0", tmp_path / "other"])
    assert run(["fleet", "fit", str(made), "--report", "page.txt"]) == 2
