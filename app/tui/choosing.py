"""Choosing what to look at: runs for the study, from the sessions or by their folders."""

import shlex
from collections.abc import Callable
from pathlib import Path

from app.session.listing import facts_of
from app.tui.dialogs import Enter, Pick
from app.tui.face import Face
from app.tui.shelf import runs_under
from app.tui.starting import session_words


def choose_runs(face: Face, then: Callable[[], None]) -> None:
    """Let the operator choose a run of the sessions, or type folders; then go on."""

    def take(runs: tuple[str, ...]) -> None:
        face.desk.study.choose(runs)
        then()

    def entered(answer: str | None) -> None:
        if answer:
            take(tuple(shlex.split(answer)))

    def type_folders() -> None:
        text = "Folders of the runs; several, with blanks between them, are fitted together"
        face.app.push_screen(Enter("Runs", text), entered)

    def picked(answer: str | None) -> None:
        if answer:
            take((answer,))
        elif answer == "":
            type_folders()

    found = [(str(run), session_words(facts_of(run.parent))) for run in runs_under(face.desk.root)]
    if found:
        options = [*found, ("", "other runs: type their folders")]
        face.app.push_screen(Pick("Run", "Runs of sessions, newest first", options), picked)
    else:
        type_folders()


def ask_for_model_file(face: Face) -> None:
    """Ask for a file and write the model there."""

    def entered(answer: str | None) -> None:
        if answer:
            face.act(lambda: face.desk.study.save(Path(answer)))

    text = "File for the effects and parameters found"
    face.app.push_screen(Enter("Save model", text, "model.toml"), entered)
