"""What happened in a session by its journal, also while another process goes on with it."""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.files.text import read_text
from app.session.facts import SessionFacts, facts_of
from app.session.journal import Journal
from app.session.within import JOURNAL, PLAN


@dataclass(frozen=True)
class Happening:
    """One line of a session: clock time (ISO 8601, UTC), machine time, what, and its words."""

    utc: str
    time_s: float
    kind: str
    text: str


def happenings(folder: Path) -> list[Happening]:
    """Everything that a session's journal tells, in order; raises BadInput if there is none."""
    steps, notes = _told(folder, _says(folder))
    return sorted((*steps, *notes), key=lambda one: one.utc)


def _says(folder: Path) -> dict[str, str]:
    """What each step of a session's plan is called."""
    plan = json.loads(read_text(folder / PLAN))
    return {step["id"]: step["says"] for step in plan["steps"]}


def _told(
    folder: Path, says: Mapping[str, str], known: tuple[int, int] = (0, 0), *, checked: bool = True
) -> tuple[list[Happening], list[Happening]]:
    """Entries of steps and notes, after the first ``known`` of each."""
    journal = Journal(folder / JOURNAL, read_only=True, checked=checked)
    try:
        steps = [
            Happening(utc, time_s, state, _step_words(says.get(step, step), result))
            for utc, time_s, step, state, result in journal.log(known[0])
        ]
        return steps, [Happening(*note) for note in journal.noted(known[1])]
    finally:
        journal.close()


def _step_words(says: str, result: Mapping[str, Any]) -> str:
    why = result.get("what") or result.get("why") or ""
    return f"{says}: {why}" if why else says


class Following:
    """A session as another process goes on with it; nothing is written.

    Parameters
    ----------
    folder : Path
        The session's folder.

    Raises
    ------
    BadInput
        If there is no session.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._says = _says(folder)
        self._known = (0, 0)
        self._facts: SessionFacts | None = None
        happenings(folder)

    @property
    def facts(self) -> SessionFacts:
        """How far it has come by now; what is finished is asked again when it goes on."""
        if self._facts is None or self._facts.state != "finished":
            self._facts = facts_of(self.folder)
        return self._facts

    def news(self) -> list[Happening]:
        """What has happened since this was asked the last time; nothing else is read."""
        steps, notes = _told(self.folder, self._says, self._known, checked=False)
        if steps or notes:
            self._facts = None
            self._known = (self._known[0] + len(steps), self._known[1] + len(notes))
        return sorted((*steps, *notes), key=lambda one: one.utc)
