"""The manual page knows every verb, and no line of it is a request; the shell completes verbs."""

import os
import shutil
import subprocess

import pytest
from click.testing import CliRunner

from app.again import command_of
from app.cli import TASKS, pkmcal
from app.manual import manual


@pytest.fixture(scope="module")
def page() -> str:
    return manual(pkmcal)


def test_every_verb_has_its_place_with_its_options(page: str) -> None:
    for _, verbs in TASKS:
        for verb in verbs:
            assert f".SS pkmcal {verb}" in page.replace("\\-", "-")
    text = page.replace("\\-", "-")
    assert "--mask" in text
    assert "--controller-port" in text  # the mock's own help
    assert "refused by a safety gate" in text


def test_lines_that_begin_with_a_dot_are_requests_that_man_knows(page: str) -> None:
    known = {".TH", ".SH", ".SS", ".TP", ".B", ".PP", ".nf", ".fi"}
    assert {line.split()[0] for line in page.splitlines() if line[:1] in (".", "'")} <= known


@pytest.mark.skipif(shutil.which("groff") is None, reason="no groff here")
def test_groff_has_nothing_to_complain_of(page: str) -> None:
    set_ = subprocess.run(
        ["groff", "-man", "-Tutf8", "-ww"], input=page, capture_output=True, text=True, check=True
    )
    assert set_.stderr == ""
    assert "calibrate parallel-kinematic machines" in set_.stdout


def test_the_option_prints_it(page: str) -> None:
    assert CliRunner().invoke(pkmcal, ["--man"]).output == page


def test_the_shell_completes_verbs() -> None:
    asked = {"COMP_WORDS": "pkmcal ver", "COMP_CWORD": "1", "_PKMCAL_COMPLETE": "bash_complete"}
    told = subprocess.run(
        command_of(), env={**os.environ, **asked}, capture_output=True, text=True, check=False
    )
    assert told.stdout == "plain,verify\n"
