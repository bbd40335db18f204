"""What the command line says of a session: n of N and words, never a step's id."""

import pytest

from app.console import ConsoleFace
from app.session import events as ev
from app.session.kinds import DRIFT


def test_steps_are_told_by_their_number_and_in_words(capsys: pytest.CaptureFixture[str]) -> None:
    face = ConsoleFace(lambda prompt, answer: None, 700, quiet=False)
    face.hear(ev.StepStarted("0510-drift-after-120", 510, DRIFT.name, "drift of the base", 1, 0.0))
    face.hear(ev.StepDone("0510-drift-after-120", 510, "base moved 10.9 um", 1.0))
    face.hear(ev.StepSkipped("0511-read-p07-4", 511, "left out by the operator", 2.0))
    assert capsys.readouterr().err.splitlines() == [
        "  511 of 700: base moved 10.9 um",
        "  512 of 700: skipped, left out by the operator",
    ]
