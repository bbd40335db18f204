"""The report is one page that carries everything within itself."""

import json
import re
from pathlib import Path

import pytest

from app.cli import run
from app.report.page import Page, Section, Table

RUN = Path(__file__).parents[1] / "data" / "runs" / "no-effect"
POSES = {f"p{k}": [k % 3 * 10.0 - 10, k // 3 * 10.0 - 10, 220.0, 0.0, 0.0, 0.0] for k in range(9)}


def verification(folder: Path, name: str, error_um: float) -> Path:
    session = folder / name
    session.mkdir()
    plan = {"format": "pkm-plan/1", "purpose": "verify", "title": "", "machine": "hexapod"}
    (session / "plan.json").write_text(json.dumps({**plan, "poses": POSES, "steps": []}))
    summary = {
        "position_peak_um": error_um, "position_std_um": 1.0, "position_rms_um": error_um,
        "orientation_peak_deg": 0.01, "orientation_std_deg": 0.001, "orientation_rms_deg": 0.01,
    }  # fmt: skip
    peaks = {"position_peak_um": 9.0, "orientation_peak_deg": 0.006}
    errors = [
        {"pose": p, "position_um": [error_um, 0.0, 0.0], "rotation_deg": [0.01, 0.0, 0.0]}
        for p in POSES
    ]
    answer = {
        "format": "pkm-verification/1", "poses": 9, "measured": summary, "truth": None,
        "noise_alone": peaks, "paper": peaks, "errors": errors, "session": str(session),
    }  # fmt: skip
    path = folder / f"{name}.json"
    path.write_text(json.dumps(answer))
    return path


def test_page_needs_nothing_beside_it(tmp_path: Path) -> None:
    out = tmp_path / "deep" / "report.html"
    before, after = (verification(tmp_path, n, e) for n, e in (("b", 600.0), ("a", 4.0)))
    arguments = ["report", str(RUN), "--before", str(before), "--after", str(after)]
    assert run([*arguments, "--out", str(out), "--json"]) == 0
    page = out.read_text(encoding="utf-8")
    assert page.count('<img src="data:image/svg+xml;base64,') == 5
    assert not re.findall(r'(?:src|href)="(?!data:)', page)
    assert "600.0" in page
    assert "Chi-square per degree of freedom 1.0" in page
    assert "leg6.L0" in page


def test_text_is_escaped() -> None:
    page = Page("<b>", "a & b", (Section("s", tables=(Table(("h",), (("<i>",),)),)),))
    assert "<b>" not in page.html()
    assert "&lt;i&gt;" in page.html()


@pytest.mark.parametrize("text", ["{", '{"format": "pkm-fit/1"}'])
def test_what_is_no_verification_is_named(
    tmp_path: Path, text: str, capsys: pytest.CaptureFixture[str]
) -> None:
    wrong = tmp_path / "wrong.json"
    wrong.write_text(text)
    assert run(["report", str(RUN), "--after", str(wrong)]) == 2
    said = capsys.readouterr().err
    assert str(wrong) in said
    assert "verify --save" in said
