"""What stands in a journal: where a step is, and moves and readings."""

import json
import sqlite3
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

PENDING = ("planned", "started", "failed")


@dataclass(frozen=True)
class StepState:
    """Where a step is: its last log entry, whose number is ``entry`` (0: there is none)."""

    state: str
    attempt: int
    result: Mapping[str, Any]
    entry: int = 0

    @property
    def pending(self) -> bool:
        """Whether the step is still to be done."""
        return self.state in PENDING


PLANNED = StepState("planned", 0, {})


@dataclass(frozen=True)
class Row:
    """A move or a reading; ``xyz`` (tracker frame, mm) and ``covariance`` only for readings."""

    seq: int
    step: str
    kind: str
    status: str
    why: str
    time_s: float
    pose: str
    nest: str
    q: tuple[float, ...]
    xyz: tuple[float, float, float] | None
    covariance: tuple[float, ...] | None
    delay_s: float | None
    cycle: int | None
    channels: Mapping[str, float]
    raw: Mapping[str, Any]


@dataclass(frozen=True)
class NewRow:
    """What the engine hands over to be written; meanings as in :class:`Row`."""

    kind: str
    time_s: float
    pose: str
    q: tuple[float, ...]
    nest: str = ""
    xyz: tuple[float, float, float] | None = None
    covariance: tuple[float, ...] | None = None
    delay_s: float | None = None
    cycle: int | None = None
    channels: Mapping[str, float] | None = None
    raw: Mapping[str, Any] | None = None
    status: str = "good"
    why: str = ""


def row_of(row: sqlite3.Row) -> Row:
    """A record of a row of the journal's table."""
    return Row(
        seq=row["seq"],
        step=row["step"],
        kind=row["kind"],
        status=row["status"],
        why=row["why"],
        time_s=row["time_s"],
        pose=row["pose"],
        nest=row["nest"],
        q=tuple(json.loads(row["q"])),
        xyz=None if row["xyz"] is None else tuple(json.loads(row["xyz"])),
        covariance=None if row["covariance"] is None else tuple(json.loads(row["covariance"])),
        delay_s=row["delay_s"],
        cycle=row["cycle"],
        channels=json.loads(row["channels"]),
        raw=json.loads(row["raw"]),
    )
