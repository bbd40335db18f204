"""Write a fit to the controller, through the gates; and bring an earlier set back."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

from app.jobs.record import Record, Report
from app.jobs.verifying import ErrorsEntry
from app.session.known import Snapshot, Snapshots
from app.session.station import Station
from app.writeback.procedure import Applied, accept, undo
from app.writeback.proposal import Proposal
from app.writeback.transfer import snapshots_of
from calib.errors import BadInput


@dataclass(frozen=True, kw_only=True)
class ChangeEntry(Record):
    """One parameter of the controller: old, new and sigma of the estimate, in ``unit``."""

    name: str
    old: float
    new: float
    sigma: float
    unit: str
    identified: bool
    in_sigmas: float | None


@dataclass(frozen=True, kw_only=True)
class ApplyReport(Report):
    """What was or would be written (``pkm-apply/1``).

    ``snapshot`` is the number of the set that was there before, the way back; ``kept`` that of the
    new one. ``check_before`` and ``check_after``: errors at the check poses.
    """

    FORMAT: ClassVar[str] = "pkm-apply/1"
    written: bool
    changes: tuple[ChangeEntry, ...]
    left_out: Mapping[str, str]
    snapshot: int | None
    kept: int | None
    check_before: ErrorsEntry | None
    check_after: ErrorsEntry | None
    noise_peak_um: float | None


@dataclass(frozen=True, kw_only=True)
class UndoReport(Report):
    """An earlier set is back in the controller (``pkm-undo/1``): its number."""

    FORMAT: ClassVar[str] = "pkm-undo/1"
    restored: int
    _snapshot: Snapshot = field(repr=False, compare=False)

    @property
    def snapshot(self) -> Snapshot:
        """The set, with its values by the controller's names."""
        return self._snapshot


@dataclass(frozen=True, kw_only=True)
class AcceptReport(Report):
    """What the controller holds is known now (``pkm-undo/1``): as the set of this number."""

    FORMAT: ClassVar[str] = "pkm-undo/1"
    accepted: int


@dataclass(frozen=True, kw_only=True)
class SetEntry(Record):
    """A set that this program knows of: when it was taken, in UTC, and why."""

    number: int
    taken_utc: str
    why: str
    checksum: int


@dataclass(frozen=True, kw_only=True)
class SetsReport(Report):
    """The sets of a controller (``pkm-undo/1``); ``unknown``: why motion is blocked, or nothing."""

    FORMAT: ClassVar[str] = "pkm-undo/1"
    sets: tuple[SetEntry, ...]
    unknown: str
    _present: frozenset[int] = field(repr=False, compare=False)

    def present(self, number: int) -> bool:
        """Whether the controller should hold this set now."""
        return number in self._present


def apply_report(proposal: Proposal, applied: Applied | None = None) -> ApplyReport:
    """What a write-back did, or would do."""
    said = {
        "format": "pkm-apply/1",
        "written": applied is not None,
        "changes": [{**vars(c), "in_sigmas": c.in_sigmas} for c in proposal.changes],
        "left_out": dict(proposal.left_out),
        "snapshot": applied and applied.snapshot.number,
        "kept": applied and applied.kept.number,
        "check_before": applied and vars(applied.before),
        "check_after": applied and vars(applied.after),
        "noise_peak_um": applied and applied.noise_peak_um,
    }
    return ApplyReport.of(said)


async def bring_back(station: Station, number: int | None) -> UndoReport:
    """Bring a set back to a connected controller: the one before the last apply if None.

    Raises
    ------
    BadInput
        If there is no such set.
    DeviceError
        If it does not read back.
    """
    snapshots = snapshots_of(station)
    chosen = snapshots.get(number) if number is not None else _before_last(snapshots)
    back = await undo(station, chosen, f"undo to {chosen.number}")
    return UndoReport.of({"format": "pkm-undo/1", "restored": back.number}, _snapshot=back)


async def accept_held(station: Station) -> AcceptReport:
    """Take what a connected controller holds as known; nothing is written."""
    saved = await accept(station)
    return AcceptReport.of({"format": "pkm-undo/1", "accepted": saved.number})


def known_sets(station: Station) -> SetsReport:
    """List the sets of a connected controller."""
    snapshots = snapshots_of(station)
    sets, expected = snapshots.all(), snapshots.expected()
    said = {
        "format": "pkm-undo/1",
        "sets": [
            {"number": s.number, "taken_utc": s.taken_utc, "why": s.why, "checksum": s.checksum}
            for s in sets
        ],
        "unknown": snapshots.unknown(),
    }
    present = frozenset(s.number for s in sets if expected and expected.values == s.values)
    return SetsReport.of(said, _present=present)


def _before_last(snapshots: Snapshots) -> Snapshot:
    """The set that was saved before the last apply."""
    before = [s for s in snapshots.all() if s.why.startswith("before applying")]
    if not before:
        raise BadInput(
            "nothing was applied to this controller",
            place=str(snapshots.folder),
            remedy="Name a set with --to; --list shows them",
        )
    return before[-1]
