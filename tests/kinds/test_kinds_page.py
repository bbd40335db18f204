"""The page of version 2 against its reader."""

import re
from pathlib import Path

from calib.runs import parse_run
from calib.runs.kinds_table import _OWN, AXIS, NUMBERS, POSE_COVARIANCES, TEXTS
from calib.runs.sensing import KINDS

PAGE = (Path(__file__).parents[2] / "docs" / "run-format-2.md").read_text(encoding="utf-8")


def block(language: str) -> str:
    (found,) = re.findall(rf"```{language}\n(.*?)```", PAGE, re.DOTALL)
    return found


def test_the_example_is_read_and_has_the_kinds_of_the_page() -> None:
    run = parse_run(block("toml"), block("csv"), actuators=3)
    assert {KINDS[kind] for kind in run.sensing.kind if kind >= 0} == set(KINDS) - {"tilt"}
    assert set(run.header.setup.nests) == {"tool", "b1", "anchor"}
    assert not run.channels


def test_every_column_of_the_reader_is_on_the_page() -> None:
    rows = dict(re.findall(r"^\| `(\w+)` \| (.*?) \|", PAGE, re.MULTILINE))
    for kind, name in enumerate(KINDS):
        wanted = _OWN[kind] - set(POSE_COVARIANCES) if name == "pose" else _OWN[kind]
        said = set(re.findall(r"`(\w+)`", rows[name]))
        assert said <= _OWN[kind]
        assert wanted <= said | {"sy", "sz", "srx", "sry"}
    assert set(TEXTS) | set(AXIS) <= set(re.findall(r"`(\w+)`", PAGE))
    assert set(NUMBERS) <= set().union(*_OWN.values())
