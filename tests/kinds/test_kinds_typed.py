"""Numbers typed in by hand: what is written, what is doubted, and that nothing typed is lost."""

import json

import numpy as np
import pytest

from app.cli import run as pkmcal
from app.doubt import doubt
from app.files.runs import read_run
from app.jobs.entering import enter
from calib.errors import BadInput

POSES = "pose,x,y,z\nA,0,0,100\nB,60,0,100\nC,0,60,100\nD,-60,-20,110\n"


@pytest.fixture
def poses(tmp_path):
    file = tmp_path / "poses.csv"
    file.write_text(POSES)
    return file


class Person:
    """Types what is listed, then nothing more; remembers what was asked and said."""

    def __init__(self, *typed):
        self.typed, self.heard = list(typed), []

    def __call__(self, question):
        self.heard.append(question)
        return self.typed.pop(0) if self.typed else "s"


def typed(folder, poses, *words, what="height", **options):
    person = Person(*words)
    report = enter(
        folder, poses, person, person.heard.append, what=what, sigma_mm=0.01,
        **({"machine": "delta"} | options),
    )  # fmt: skip
    return report, person


def test_numbers_are_rows_of_a_run_and_the_same_command_goes_on(tmp_path, poses):
    folder = tmp_path / "run"
    report, _ = typed(folder, poses, "100.11", "99.95", "b", "99.96", "")
    assert (report.readings, report.typed, report.left) == (2, 2, ("C", "D"))
    report, person = typed(folder, poses, "100.05", "109.9")
    assert report.left == ()
    assert [heard.split(":")[0] for heard in person.heard] == ["pose C", "pose D"]
    report, _ = typed(
        folder, poses, "60.01", "60.07", what="calipers", pairs=[("A", "B"), ("A", "C")]
    )
    run = read_run(folder).run
    assert list(run.position[2, run.measured][:4]) == [100.11, 99.96, 100.05, 109.9]
    assert list(run.position[0, run.measured][4:]) == [60.01, 60.07]
    assert run.pose[0] == "home"
    assert np.all(np.diff(run.time_s) >= 0.0)


def test_an_inch_gauge_with_a_decimal_comma_begins_at_any_zero(tmp_path, poses):
    folder = tmp_path / "run"
    heights = [(mm - 87.0) / 25.4 for mm in (100.0, 100.1, 99.9, 110.0)]
    words = [f"{inches:.5f}".replace(".", ",") for inches in heights]
    report, person = typed(folder, poses, *words, what="gauge", unit="in", decimal=",")
    assert report.readings == 4
    assert len(person.heard) == 4
    run = read_run(folder).run
    assert run.position[0, run.measured] == pytest.approx(np.array(heights) * 25.4, abs=2e-4)


def test_a_mistake_is_doubted_and_what_was_meant_is_offered(tmp_path, poses):
    report, person = typed(tmp_path / "run", poses, "100.1", "-99.95", "m", "1o0", "10.01", "", "s")
    assert report.typed == 2
    said = "\n".join(person.heard)
    assert "99.95 was meant (the sign)" in said
    assert '"1o0" is no number' in said
    assert "100.1 was meant (the decimal point one place)" in said


def test_what_people_mistype_is_found_and_right_numbers_are_not_doubted():
    """A hundred heights, each typed right and in five wrong ways."""
    rng = np.random.default_rng(4)
    expected = rng.uniform(30.0, 300.0, 100)
    read = [float(f"{value:.3f}") for value in expected + 0.5 * rng.standard_normal(100)]
    wrong = {
        "the sign": lambda text: f"-{text}",
        "the decimal point one place": lambda text: f"{float(text) / 10:.4f}",
        "inches": lambda text: f"{float(text) / 25.4:.5f}",
        "a unit a thousand times larger": lambda text: f"{float(text) / 1000:.6f}",
    }
    before: list[tuple[float, float]] = []
    for value, should in zip(read, expected, strict=True):
        assert doubt(f"{value}", value, should, before, 2.0, False, float) is None
        for how, change in wrong.items():
            text = change(f"{value}")
            found = doubt(text, float(text), should, before, 2.0, False, float)
            assert found is not None
            assert found.how == how
            assert found.meant == pytest.approx(value, abs=0.02)
        before.append((value, should))


def test_a_number_that_comes_twice_while_the_machine_moves_is_doubted():
    before = [(100.0, 100.0), (105.5, 105.4)]
    assert doubt("105.5", 105.5, 107.0, before, 2.0, False, float) is not None
    assert doubt("105.5", 105.5, 105.5, before, 2.0, False, float) is None


@pytest.mark.parametrize(
    ("options", "what", "said"),
    [
        ({"pairs": [("A", "X")]}, "calipers", 'no pose "X"'),
        ({}, "calipers", "which marks"),
        ({"pairs": [("A", "B")]}, "height", "for calipers"),
        ({"machine": None}, "height", "no machine"),
    ],
)
def test_what_cannot_be_asked_is_refused(tmp_path, poses, options, what, said):
    with pytest.raises(BadInput, match=said):
        typed(tmp_path / "run", poses, "100.0", what=what, **options)


def test_a_run_of_others_is_left_alone(tmp_path, poses):
    folder = tmp_path / "run"
    assert pkmcal(["simulate", "delta", "--poses", "3", "--out", str(folder)]) == 0
    there = (folder / "points.csv").read_bytes()
    with pytest.raises(BadInput, match="was not typed in"):
        typed(folder, poses, "100.0")
    assert (folder / "points.csv").read_bytes() == there


def test_the_verb_reads_lines_and_answers_as_its_schema(tmp_path, poses, monkeypatch, capsys):
    import io

    monkeypatch.setattr("sys.stdin", io.StringIO("100.1\n99.9\n"))
    words = ["enter", str(tmp_path / "run"), "--poses", str(poses), "--machine", "delta"]
    assert pkmcal([*words, "--sigma-um", "10", "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert (answer["readings"], answer["left"]) == (2, ["C", "D"])
    assert pkmcal([*words, "--sigma-um", "0"]) == 2
