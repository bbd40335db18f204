"""A session that another terminal runs, as its journal tells of it; nothing here reaches it."""

import asyncio
import time
from pathlib import Path

from app.session.facts import SessionFacts
from app.session.happenings import Following, Happening
from app.show.clocks import happening_line
from app.tui.parts import Level
from app.tui.picture import Picture

SILENT_S = 30.0
"""After so long without an entry it is said that nothing happens."""
_LEVELS: dict[str, Level] = {"done": "good", "failed": "bad", "skipped": "warn", "alarm": "warn"}


class Watching:
    """One session; ``picture`` holds its lines, ``facts`` how far it has come."""

    def __init__(self, folder: Path) -> None:
        self._followed = Following(folder)
        self._quiet_since = time.monotonic()
        self.folder = folder
        self.picture = Picture()
        self.facts: SessionFacts = self._followed.facts
        self.doing = ""

    async def look(self) -> bool:
        """Read what is new, beside the event loop; whether there was anything.

        Raises
        ------
        BadInput
            If the session's folder is gone.
        """
        news, self.facts = await asyncio.to_thread(self._read)
        for one in news:
            if one.kind == "started":
                self.doing = one.text
            else:
                line = happening_line(one.utc, one.kind, one.text)
                self.picture.write(line, _LEVELS.get(one.kind, "info"))
        if news:
            self._quiet_since = time.monotonic()
        return bool(news)

    def _read(self) -> tuple[list[Happening], SessionFacts]:
        return self._followed.news(), self._followed.facts

    @property
    def quiet_s(self) -> float:
        """How long nothing has happened, where that is worth a word; 0 where it is not."""
        quiet = time.monotonic() - self._quiet_since
        return quiet if quiet > SILENT_S and self.facts.state == "begun" else 0.0
