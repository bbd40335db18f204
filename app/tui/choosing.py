"""Choosing what to look at and where to write: sites, runs and models, found, browsed or typed."""

import shlex
from collections.abc import Callable, Sequence
from pathlib import Path

from app.session.facts import facts_of
from app.tui.browsing import Browse
from app.tui.dialogs import Choose, Enter, Pick
from app.tui.face import Face
from app.tui.shelf import runs_under
from app.tui.starting import session_words

BROWSE, TYPE = " browse", " type"
"""Answers that are no file: none begins with a blank."""
OVERWRITE, ANOTHER = "overwrite", "another name"


def says_of_itself(form: str) -> Callable[[Path], bool]:
    """Whether a file is TOML and names this format in its head."""

    def wanted(path: Path) -> bool:
        if path.suffix != ".toml":
            return False
        try:
            with path.open(encoding="utf-8", errors="replace") as text:
                return form in text.read(400)
        except OSError:
            return False

    return wanted


IS_SITE, IS_MODEL, IS_POSES = map(says_of_itself, ("pkm-site/1", "pkm-model/1", "pkm-poses/1"))


def here(folder: Path, wanted: Callable[[Path], bool]) -> list[tuple[str, str]]:
    """Files in a folder and one level below that are wanted: path, and what to show."""
    found = sorted({*folder.glob("*.toml"), *folder.glob("*/*.toml")})
    return [(str(path), str(path)) for path in found[:200] if wanted(path)]


def choose_file(
    face: Face,
    title: str,
    found: Sequence[tuple[str, str]],
    wanted: Callable[[Path], bool],
    then: Callable[[Path], None],
    what: str,
) -> None:
    """Let the operator take one of the files found, look for another one, or type its path."""

    def taken(answer: str | None) -> None:
        if answer:
            then(Path(answer).expanduser())

    def picked(answer: str | None) -> None:
        if answer == BROWSE:
            text = f"Open folders down to the {what}, and take it"
            face.app.push_screen(Browse(title, text, Path(), wanted), taken)
        elif answer == TYPE:
            face.app.push_screen(Enter(title, f"Path of the {what}"), taken)
        else:
            taken(answer)

    options = [
        *found,
        (BROWSE, "another one: look for it in the folders"),
        (TYPE, "another one: type its path"),
    ]
    text = f"A {what} found here, or another one" if found else f"No {what} is here"
    face.app.push_screen(Pick(title, text, options), picked)


def choose_model(face: Face, then: Callable[[Path], None]) -> None:
    """Let the operator take a model file: those of the sessions first, newest first."""
    root = face.desk.root
    of_sessions = sorted(root.glob("*/model.toml"), reverse=True)
    options = [(str(path), _of_session(path)) for path in of_sessions]
    known = {path.resolve() for path in of_sessions}
    options += [one for one in here(Path(), IS_MODEL) if Path(one[0]).resolve() not in known]
    choose_file(face, "Load model", options, IS_MODEL, then, "model file")


def _of_session(model: Path) -> str:
    facts = facts_of(model.parent)
    return str(model) if facts.state == "broken" else f"model of {session_words(facts)}"


def begin_with_model(face: Face, then: Callable[[], None]) -> None:
    """Let the operator take the effects of a model file for the chosen run; then go on."""

    def taken(model: Path) -> None:
        async def begin() -> None:
            await face.desk.study.begin_with(model)
            then()

        face.act(begin)

    choose_model(face, taken)


def choose_runs(face: Face, then: Callable[[], None]) -> None:
    """Let the operator choose a run of the sessions, or type folders; then go on."""

    def take(runs: tuple[str, ...]) -> None:
        face.desk.study.choose(runs)
        then()

    def entered(answer: str | None) -> None:
        if answer:
            take(tuple(shlex.split(answer)))

    def found_in_folders(answer: str | None) -> None:
        if answer:
            take((str(Path(answer).parent),))

    def picked(answer: str | None) -> None:
        if answer == BROWSE:
            text = "Open folders down to the run.toml of a run, and take it"
            browse = Browse("Run", text, Path(), lambda path: path.name == "run.toml")
            face.app.push_screen(browse, found_in_folders)
        elif answer == TYPE:
            text = "Folders of the runs; several, with blanks between them, are fitted together"
            face.app.push_screen(Enter("Runs", text), entered)
        elif answer:
            take((answer,))

    found = [(str(run), session_words(facts_of(run.parent))) for run in runs_under(face.desk.root)]
    options = [
        *found,
        (BROWSE, "another run: look for it in the folders"),
        (TYPE, "several runs, or one elsewhere: type their folders"),
    ]
    text = "Runs of sessions, newest first" if found else "No session here has a run yet"
    face.app.push_screen(Pick("Run", text, options), picked)


def ask_for_model_file(face: Face) -> None:
    """Ask for a file and write the model there."""
    text = (
        "File for the effects and parameters found; with .svg, .png or .pdf for the staircase as a "
        "picture"
    )
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
