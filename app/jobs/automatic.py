"""What an automatic calibration answers."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from app.jobs.record import Record, Report


@dataclass(frozen=True, kw_only=True)
class DecisionEntry(Record):
    """One decision: what, why, what was expected of it, and what came of it in words.

    ``count`` poses, or ``minutes`` of letting it warm up.
    """

    number: int
    kind: str
    why: str
    count: int
    minutes: float
    pair: tuple[str, ...]
    expected: Mapping[str, float]
    came: str


@dataclass(frozen=True, kw_only=True)
class AutoReport(Report):
    """How an automatic calibration went (``pkm-auto/1``).

    ``reached``: whether the target holds at fresh poses; None where nothing was to be written.
    ``predicted_um``, ``verified_um``: RMS of the position error at fresh poses, the latter without
    the tracker's part; ``at_most_um`` is its 95 % limit. ``minutes``: machine time of all readings.
    ``in_question``: pairs of effects that stayed so, and why. ``not_asked``: effects that the
    readings cannot show (no load is known, no temperature was read), ``not_written``: effects that
    were found and stay in the machine; each with the reason.
    """

    FORMAT: ClassVar[str] = "pkm-auto/1"
    folder: str
    target_um: float
    reached: bool | None
    why: str
    decisions: tuple[DecisionEntry, ...]
    runs: tuple[str, ...]
    model: str | None
    effects: tuple[str, ...]
    in_question: Mapping[str, str]
    not_asked: Mapping[str, str]
    not_written: Mapping[str, str]
    poses: int
    minutes: float
    predicted_um: float | None
    verified_um: float | None
    at_most_um: float | None
