"""When and how a run or a session was measured: times, devices, conditions."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from app.session.journal import IDENTITIES, Journal
from app.session.within import JOURNAL
from calib.arrays import Array


@dataclass(frozen=True)
class Span:
    """Lowest, mean and highest of a channel."""

    low: float
    mean: float
    high: float


@dataclass(frozen=True)
class Taken:
    """When something was measured, by which devices, under which conditions; empty if not known.

    ``begun`` and ``ended`` are ISO 8601, UTC; ``identities`` by role (``controller``, ``tracker``).
    """

    begun: str = ""
    ended: str = ""
    readings: int = 0
    identities: Mapping[str, Mapping[str, str]] = field(default_factory=dict)
    channels: Mapping[str, Span] = field(default_factory=dict)


def taken_in(session: Path) -> Taken:
    """How a session was measured, from its journal; raises BadInput if there is none."""
    journal = Journal(session / JOURNAL, read_only=True)
    try:
        rows = journal.rows()
        readings = [row for row in rows if row.kind == "reading"]
        names = {name for row in readings for name in row.channels}
        channels = {
            name: _span([row.channels[name] for row in readings if name in row.channels])
            for name in sorted(names)
        }
        return Taken(
            journal.meta("begun_utc", ""),
            journal.meta("finished_utc", ""),
            len(readings),
            journal.meta(IDENTITIES, {}),
            channels,
        )
    finally:
        journal.close()


def spans(columns: Mapping[str, Iterable[Array]]) -> dict[str, Span]:
    """Ranges of the channels of several runs."""
    joined = {name: np.concatenate(list(parts)) for name, parts in columns.items()}
    return {name: _span(values) for name, values in joined.items() if np.isfinite(values).any()}


def _span(values: Sequence[float] | Array) -> Span:
    known = np.asarray(values, dtype=float)
    known = known[np.isfinite(known)]
    return Span(float(known.min()), float(known.mean()), float(known.max()))
