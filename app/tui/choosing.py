"""Choosing what to look at: runs for the study, from the sessions or by their folders."""

import shlex
from collections.abc import Callable, Sequence
from pathlib import Path

from app.session.listing import facts_of
from app.tui.dialogs import Choose, Enter, Pick
from app.tui.face import Face
from app.tui.shelf import runs_under
from app.tui.starting import session_words

OVERWRITE, ANOTHER = "overwrite", "another name"


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
    text = "File for the effects and parameters found"
    ask_for_file(
        face, "Save model", text, "model.toml",
        lambda path: face.act(lambda: face.desk.study.save(path)),
    )  # fmt: skip


def ask_for_file(
    face: Face,
    title: str,
    text: str,
    value: str,
    then: Callable[[Path], None],
    endings: Sequence[str] = (),
) -> None:
    """Ask where to write, and once more where that would overwrite something; then go on.

    ``endings`` are those with which the file is written, where they are not its own.
    """

    def entered(answer: str | None) -> None:
        if not answer:
            return
        path = Path(answer).expanduser()
        written = [path.with_suffix(ending) for ending in endings] or [path]
        there = [str(one) for one in written if one.exists()]
        if not there:
            then(path)
            return

        def sure(choice: str | None) -> None:
            if choice == OVERWRITE:
                then(path)
            elif choice == ANOTHER:
                ask_for_file(face, title, text, answer, then, endings)

        said = f"{' and '.join(there)} {'is' if len(there) == 1 else 'are'} there already."
        face.app.push_screen(Choose("Overwrite?", said, (OVERWRITE, ANOTHER), first=ANOTHER), sure)

    face.app.push_screen(Enter(title, text, value), entered)
