"""Every verb is in the list of tasks and on a page, and what it answers as data has a schema."""

import json
import re
import runpy
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import click
import pytest

from app.cli import TASKS, pkmcal, run
from app.jobs.record import Report
from app.jobs.schema import schema_of
from tests.answers import SCHEMAS, faults, faults_of, schemas

ROOT = Path(__file__).parents[2]
RUNS = ROOT / "tests" / "data" / "runs"
PAGE = (ROOT / "docs" / "verbs-and-answers.md").read_text(encoding="utf-8")
RUN = str(RUNS / "no-effect")
MAPS = ROOT / "tests" / "data" / "maps"
WRITER = runpy.run_path(str(ROOT / "docs" / "make_schemas.py"))

# How each verb is asked here. On a station: in the tests of the whole job, by the same schemas.
ASKED: dict[str, tuple[str, ...] | None] = {
    "machine check": ("machine", "check", "ptm"),
    "machine complete": ("machine", "complete", "arm"),
    "kinematics": ("kinematics", "arm", "--inverse", "{}/poses.csv"),
    "poses": ("poses", "tripod", "--n", "6", "--candidates", "12", "--out", "{}/poses.toml"),
    "design": (
        *("design", RUN, "--discriminate", "gravity-sag", "nothing"),
        *("--n", "2", "--candidates", "20"),
    ),
    "sensitivity": ("sensitivity", "hexapod", "--poses", "5", "--position-um", "100"),
    "identifiability": ("identifiability", "tripod"),
    "measure": None,
    "resume": None,
    "enter": None,
    "import": (
        *("import", f"{RUN}/points.csv", "--map", f"{MAPS}/own-points.toml"),
        *("--header", f"{RUN}/run.toml", "--out", "{}/imported"),
    ),
    "fit": ("fit", RUN, "--add", "backlash"),
    "compare": ("compare", RUN),
    "fleet fit": ("fleet", "fit", RUN, f"{RUNS}/backlash-leg-3", "--workers", "1"),
    "predict": ("predict", "{}/model.toml", RUN, "--frame"),
    "diagnose": ("diagnose", RUN),
    "discover": ("discover", RUN),
    "auto": None,
    "apply": None,
    "undo": None,
    "correct": ("correct", "{}/model.toml", "--pose", "0 0 220 0 0 0"),
    "verify": None,
    "iso9283": ("iso9283", "{}/cycles"),
    "report": ("report", RUN, "--out", "{}/report.html"),
    "demo": None,
    "simulate": ("simulate", "tripod", "--poses", "3", "--out", "{}/run"),
    "site kinds": ("site", "kinds"),
    "sessions": ("sessions", "--folder", "{}"),
    "log": None,
    "history": ("history", "--folder", "{}"),
}


def leaves(group: click.Group = pkmcal, before: str = "") -> Iterator[tuple[str, click.Command]]:
    context = click.Context(group)
    for name in group.list_commands(context):
        command = group.get_command(context, name)
        assert command is not None
        words = f"{before} {name}".strip()
        if isinstance(command, click.Group):
            yield from leaves(command, words)
        else:
            yield words, command


VERBS = dict(leaves())
IN_JSON = [name for name, verb in VERBS.items() if any(p.name == "as_json" for p in verb.params)]


@pytest.mark.parametrize("name", VERBS)
def test_completeness_verb_is_a_task_has_a_page_and_explains_its_options(name: str) -> None:
    assert name.split()[0] in [verb for _, verbs in TASKS for verb in verbs]
    row = next(line for line in PAGE.splitlines() if line.startswith(f"| `pkmcal {name}` |"))
    answers = re.findall(r"\(schemas/([\w-]+)\.json\)", row)
    assert bool(answers) == (name in IN_JSON)
    for answer in answers:
        assert f"[`{schemas()[answer]['title']}`](schemas/{answer}.json)" in row
    for option in VERBS[name].params:
        if isinstance(option, click.Option) and option.name not in ("n", "machine"):
            assert option.help or option.required or option.show_default or option.default, option


@pytest.mark.long
@pytest.mark.parametrize("name", IN_JSON)
def test_completeness_verb_answers_by_its_schema(
    name: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A verb that is new here says how it is asked; None where it takes a station."""
    words = ASKED[name]
    if words is None:
        return
    (tmp_path / "poses.csv").write_text("x,y,z,rx,ry [deg],rz\n500,0,830,0,45,0\n")
    if name in ("correct", "predict"):
        assert run(["fit", RUN, "--save", str(tmp_path / "model.toml")]) == 0
        capsys.readouterr()
    if name == "iso9283":
        campaign = ["simulate", "hexapod", "--poses", "3", "--cycles", "3"]
        assert run([*campaign, "--out", str(tmp_path / "cycles")]) == 0
        capsys.readouterr()
    assert run([*(word.format(tmp_path) for word in words), "--json"]) == 0
    assert faults_of(json.loads(capsys.readouterr().out)) == []


def test_completeness_every_report_has_its_schema_as_declared() -> None:
    """Written by python docs/make_schemas.py; those kept by hand belong to other formats."""
    reports = WRITER["reports"]()
    for report in reports:
        path = SCHEMAS / f"{report.__name__}.json"
        assert path.read_text(encoding="utf-8") == WRITER["text_of"](report), path
    assert {report.__name__ for report in reports} <= set(schemas())


def test_completeness_page_shows_every_schema_and_no_verb_that_is_gone() -> None:
    shown = set(re.findall(r"\(schemas/([\w-]+)\.json\)", PAGE))
    assert shown == set(schemas())
    assert set(re.findall(r"^\| `pkmcal ([^`]+)`", PAGE, re.MULTILINE)) == set(VERBS)


def test_completeness_answer_that_is_not_as_its_schema_is_told() -> None:
    @dataclass(frozen=True, kw_only=True)
    class Weight(Report):
        """How heavy it is (``pkm-weight/1``)."""

        FORMAT: ClassVar[str] = "pkm-weight/1"
        mass_kg: float | None
        parts: tuple[str, ...]

    schema = schema_of(Weight)
    good = {"format": "pkm-weight/1", "mass_kg": 1, "parts": ["a"]}
    assert list(faults(good, schema)) == []
    for change, said in (
        ({"mass_kg": "1"}, "answer.mass_kg is no"),
        ({"mass_kg": True}, "answer.mass_kg is no"),
        ({"parts": ["a", 1]}, "answer.parts[1] is no string"),
        ({"parts": "a"}, "answer.parts is no array"),
        ({"weight": 1}, "answer has weight, of which"),
        ({"format": "pkm-weight/2"}, "not 'pkm-weight/1'"),
    ):
        assert said in "; ".join(faults({**good, **change}, schema))
    assert list(faults({"format": "pkm-weight/1"}, schema)) == [
        "answer lacks mass_kg",
        "answer lacks parts",
    ]
    assert faults_of(good) == ["docs/schemas has none for the format 'pkm-weight/1'"]
