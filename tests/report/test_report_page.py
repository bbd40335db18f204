"""The calibration record: what it says, and that it carries everything within itself."""

import json
import re
from dataclasses import replace
from pathlib import Path

import pytest

from app.cli import run
from app.report.accuracy import Tolerance, judge_tolerance
from app.report.html import html_of
from app.report.page import Facts, Page, Section, Table, Text
from app.report.pdf import pdf_of
from app.report.sources import Checked
from app.report.words import with_uncertainty
from app.session.taken import Taken
from calib.errors import BadInput

RUN = Path(__file__).parents[1] / "data" / "runs" / "no-effect"
POSES = {f"p{k}": (k % 3 * 10.0 - 10, k // 3 * 10.0 - 10, 220.0, 0.0, 0.0, 0.0) for k in range(9)}
PAGE = Page(
    "Calibration record", "7", "2026-11-29", "Lab\nStreet", Facts((("Customer", "<b> & Co"),)),
    (Section("s", (Text("t"), Table(("h", "n"), (("<i>", "1"),)))),), (), ("Calibrated by",),
)  # fmt: skip


def answer(error_um: float, expanded_um: float | None = 2.0) -> dict[str, object]:
    """A verification whose errors all point along x."""
    summary = {
        "position_peak_um": error_um, "position_std_um": 1.0, "position_rms_um": error_um,
        "orientation_peak_deg": 0.01, "orientation_std_deg": 0.001, "orientation_rms_deg": 0.01,
    }  # fmt: skip
    peaks = {"position_peak_um": 9.0, "orientation_peak_deg": 0.006}
    errors = [
        {
            "pose": p, "position_um": [error_um, 0.0, 0.0], "rotation_deg": [0.01, 0.0, 0.0],
            "position_u_um": expanded_um, "rotation_u_deg": expanded_um and 1e-3,
        }
        for p in POSES
    ]  # fmt: skip
    return {
        "format": "pkm-verification/1", "poses": 9, "measured": summary, "truth": None,
        "noise_alone": peaks, "paper": peaks, "errors": errors,
    }  # fmt: skip


def verification(folder: Path, name: str, error_um: float) -> Path:
    session = folder / name
    session.mkdir()
    plan = {"format": "pkm-plan/1", "purpose": "verify", "title": "", "machine": "hexapod"}
    (session / "plan.json").write_text(json.dumps({**plan, "poses": POSES, "steps": []}))
    path = folder / f"{name}.json"
    path.write_text(json.dumps({**answer(error_um), "session": str(session)}))
    return path


@pytest.fixture(scope="module")
def written(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A record of two runs with both verifications and a tolerance, both forms of it."""
    folder = tmp_path_factory.mktemp("record")
    before, after = (verification(folder, n, e) for n, e in (("b", 600.0), ("a", 4.0)))
    out = folder / "deep" / "report"
    arguments = ["report", str(RUN), str(RUN.parent / "backlash-leg-3")]
    arguments += ["--before", str(before), "--after", str(after), "--add", "backlash"]
    arguments += ["--tolerance-um", "50", "--number", "K-7"]
    outs = ["--out", str(out.with_suffix(".html")), "--out", str(out.with_suffix(".pdf"))]
    assert run([*arguments, *outs, "--json"]) == 0
    return out


def test_the_record_needs_nothing_beside_it(written: Path) -> None:
    page = written.with_suffix(".html").read_text(encoding="utf-8")
    assert page.count('<img src="data:image/svg+xml;base64,') >= 5
    assert not re.findall(r'(?:src|href)="(?!data:)', page)
    assert written.with_suffix(".pdf").read_bytes().startswith(b"%PDF-")


def test_the_record_says_what_was_found_and_what_is_left(written: Path) -> None:
    page = written.with_suffix(".html").read_text(encoding="utf-8")
    assert "No. K-7" in page
    assert "<b>PASS</b>" in page
    assert "600" in page
    assert "leg6.L0" in page
    assert "moves the reflector" in page
    assert "Nothing was written to the controller" in page
    assert "Han" not in page


def test_the_drift_of_each_run_is_said(written: Path) -> None:
    page = written.with_suffix(".html").read_text(encoding="utf-8")
    said = re.search(r"in each run, at most: ([\d.]+) µm in run 1, ([\d.]+) µm in run 2", page)
    assert said is not None
    assert said[1] != said[2]


def test_a_name_is_text_in_both_forms() -> None:
    page = html_of(PAGE)
    assert "&lt;b&gt; &amp; Co" in page
    assert "&lt;i&gt;" in page
    assert pdf_of(PAGE).startswith(b"%PDF-")


def test_a_template_and_a_logo_of_ones_own_are_used(tmp_path: Path) -> None:
    logo = tmp_path / "logo.svg"
    logo.write_text('<svg xmlns="http://www.w3.org/2000/svg" width="9" height="9"></svg>')
    (tmp_path / "own.html").write_text("{{ record.number }}|{{ logo[:18] }}")
    (tmp_path / "own.typ").write_text('#let r = json("record.json")\n#r.title #image(r.logo)')
    page = replace(PAGE, logo=str(logo))
    assert html_of(page, str(tmp_path / "own.html")) == "7|data:image/svg+xml"
    assert pdf_of(page, str(tmp_path / "own.typ")).startswith(b"%PDF-")


def test_a_fault_in_a_template_is_named(tmp_path: Path) -> None:
    for name, text in (("own.html", "{{ record.nobody }}"), ("own.typ", "#nobody")):
        (tmp_path / name).write_text(text)
        with pytest.raises(BadInput, match="nobody") as fault:
            (html_of if name.endswith("html") else pdf_of)(PAGE, str(tmp_path / name))
        assert name in fault.value.place


@pytest.mark.parametrize(
    "evil",
    [
        "{{ ''.__class__.__mro__[1].__subclasses__() }}",
        "{{ cycler.__init__.__globals__.os.getcwd() }}",
        "{% for k in range(10000000) %}{% endfor %}",
    ],
)
def test_a_template_of_somebody_else_s_runs_nothing(tmp_path: Path, evil: str) -> None:
    template = tmp_path / "evil.html"
    template.write_text(evil)
    with pytest.raises(BadInput, match=r"evil\.html"):
        html_of(PAGE, str(template))


def test_a_pose_passes_only_with_its_uncertainty_within_the_tolerance() -> None:
    def judged(error_um: float) -> tuple[bool, bool]:
        checked = Checked(answer(error_um, expanded_um=2.0), POSES, Taken())
        (one,) = judge_tolerance(checked, Tolerance(um=10.0))
        return one.passed, one.open

    assert judged(7.9) == (True, False)
    assert judged(8.1) == (False, True)
    assert judged(11.9) == (False, True)
    assert judged(12.1) == (False, False)


def test_nothing_is_judged_without_an_uncertainty() -> None:
    checked = Checked(answer(1.0, expanded_um=None), POSES, Taken())
    assert judge_tolerance(checked, Tolerance(um=10.0)) == ()


@pytest.mark.parametrize(
    ("value", "uncertainty", "said"),
    [
        (230.612345, 0.00481, ("230.6123", "0.0048")),
        (-0.00001, 0.02, ("0.000", "0.020")),
        (-1234.5, 96.0, ("−1234", "96")),
        (3.0, 0.0, ("3", "–")),
    ],
)
def test_values_are_printed_to_the_second_digit_of_their_uncertainty(
    value: float, uncertainty: float, said: tuple[str, str]
) -> None:
    assert with_uncertainty(value, uncertainty) == said


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
