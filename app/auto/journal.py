"""The journal of decisions: one line of JSON each, on the disk before anything is done."""

import json
import os
from collections.abc import Iterator, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from app.plain_data import plain
from calib.errors import BadInput

NAME, FORMAT = "decisions.jsonl", "pkm-decisions/1"


class Decisions:
    """What was decided, begun and done in one folder; the truth about where to go on.

    Parameters
    ----------
    folder : Path
        It is there.
    """

    def __init__(self, folder: Path) -> None:
        self.path = folder / NAME
        self.lines: list[dict[str, Any]] = list(self._read())

    def _read(self) -> Iterator[dict[str, Any]]:
        if not self.path.exists():
            return
        texts = self.path.read_bytes().split(b"\n")
        for number, text in enumerate(texts, start=1):
            if number == len(texts):  # whole lines end with a newline: this one was torn
                self._cut(len(text))
                return
            try:
                line = json.loads(text)
            except ValueError:
                line = None
            if not isinstance(line, dict) or "event" not in line:
                raise BadInput(
                    "not a line of a journal of decisions",
                    place=f"{self.path}:{number}",
                    remedy="Begin anew in another folder; the sessions in this one are whole",
                )
            yield line

    def _cut(self, excess: int) -> None:
        if excess:
            os.truncate(self.path, self.path.stat().st_size - excess)

    def write(self, event: str, **data: Any) -> dict[str, Any]:
        """Append a line; it is on the disk when this returns."""
        line: dict[str, Any] = plain(
            {"event": event, "utc": datetime.now(UTC).isoformat(timespec="seconds"), **data}
        )
        with self.path.open("ab") as file:
            file.write(json.dumps(line, ensure_ascii=False).encode() + b"\n")
            file.flush()
            os.fsync(file.fileno())
        self.lines.append(line)
        return line

    def of(self, event: str) -> list[dict[str, Any]]:
        """All lines of one event, in order."""
        return [line for line in self.lines if line["event"] == event]

    @property
    def begun(self) -> Mapping[str, Any] | None:
        """How it was begun: site, limits, seed; None in a new folder."""
        first = self.of("begun")
        return first[0] if first else None

    @property
    def open(self) -> dict[str, Any] | None:
        """The last decision, if it was not carried out to its end."""
        decided = self.of("decided")
        ended = {line["number"] for line in self.of("done")}
        return decided[-1] if decided and decided[-1]["number"] not in ended else None

    def session_of(self, number: int) -> str | None:
        """The session that decision ``number`` has begun, if it came so far."""
        begun = [line["session"] for line in self.of("session") if line["number"] == number]
        return begun[-1] if begun else None
