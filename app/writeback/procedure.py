"""The whole write-back: snapshot, gates, trial in volatile memory, check poses, and only then keep.

Whatever fails on the way, the set that was there before is brought back and read back; if that
fails as well, the parameters are unknown and motion stays blocked until a known set is back.
"""

import asyncio
import math
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

from app.errors import GateRefused, StoppedByOperator
from app.files.fits import SavedFit
from app.files.pose_table import Pose
from app.files.site import Site
from app.history.store import Entry, History
from app.hosted.controller import HostedController
from app.hosted.parameters import ParameterSet
from app.session.events import GateChecked, Stage, WriteBackStage
from app.session.known import Held, Snapshot, compare_with_known
from app.session.plans import PlanOptions, measure_plan, order_for
from app.session.session import Session
from app.session.station import Station
from app.verification import Verification, judge
from app.writeback.gates import Gates, HostedSets, gates_of_check, gates_of_proposal, refuse_if_any
from app.writeback.proposal import Proposal, propose
from app.writeback.transfer import Wanted, keep, prove, snapshots_of, write_volatile
from calib.errors import BadInput
from calib.pose_error import Summary
from calib.poses import verification_poses
from drivers.errors import DeviceError, ParameterError, Refused

CHECK_POSES = 8
Confirm = Callable[[Proposal, Summary, Summary], Awaitable[bool]]


@dataclass(frozen=True)
class Applied:
    """What a write-back did: the way back is ``snapshot``."""

    snapshot: Snapshot
    kept: Snapshot
    proposal: Proposal
    before: Summary
    after: Summary
    noise_peak_um: float


@dataclass
class WriteBack:
    """One write-back on a connected station.

    Parameters
    ----------
    station : Station
    fit : SavedFit
    gates : Gates
    root : Path
        Where the sessions of the check poses get their folders.
    confirm : coroutine function
        Asks the person: proposal, check poses before and after -> keep it?
    unattended : bool
        As for :class:`Session`.
    poses : mapping, optional
        Check poses, not among the fitted ones; eight of the verification grid by default.
    """

    station: Station
    fit: SavedFit
    gates: Gates
    root: Path
    confirm: Confirm
    unattended: bool = False
    poses: Mapping[str, Pose] = field(default_factory=dict)
    running: Session | None = None
    """The session that measures check poses at this moment."""
    _stored: bool = False
    _stopping: bool = False

    async def propose(self) -> tuple[Held, Proposal]:
        """Read the controller, compare with the fit, and judge; nothing is written.

        Raises
        ------
        GateRefused
            Naming every gate that did not pass.
        ParameterError
            If the controller does not hold what is known.
        """
        site = self.station.site
        controller = self.station.controller
        held = await compare_with_known(site, controller)
        told = await controller.frame() if isinstance(controller, HostedController) else {}
        serial = controller.identity.serial
        proposal, checked = judged(site, self.gates, self.fit, held, serial, told)
        for gate in checked:
            self.station.observers.tell(gate)
        refuse_if_any(checked, "Nothing was written. Measure more, or fit again")
        return held, proposal

    async def run(self) -> Applied:
        """Write, try, and keep; or put everything back.

        Raises
        ------
        BadInput
            If the site has no tracker to measure check poses with.
        GateRefused
            If a gate or the person said no; the earlier set is back.
        DeviceError
            If something broke; the message says whether the earlier set is back.
        StoppedByOperator
            If the operator stopped; the earlier set is back.
        """
        _ = self.station.site.tracker  # check poses are measured with it: refused before anything
        held, proposal = await self.propose()
        snapshots = snapshots_of(self.station)
        snapshot = snapshots.save(held, f"before applying {Path(self.fit.source).name}")
        saved = f"{len(held.values)} parameters saved as set {snapshot.number}"
        self._stage("snapshot", f"{saved}: {snapshots.path(snapshot)}")
        before = await self._measure("before", held.values)
        after = before
        wanted = Wanted(proposal.over(held.values), proposal.own)
        try:
            self._stage("write", f"{len(proposal.changes)} values into volatile memory")
            await write_volatile(self.station, wanted)
            self._stage("read-back", "every value reads back bit for bit")
            after = await self._measure("after", wanted.values)
            checked = gates_of_check(
                self.gates, before.measured, after.measured, after.noise_peak_um
            )
            for gate in checked:
                self.station.observers.tell(gate)
            refuse_if_any(checked, "The fit does not hold on poses that it had not seen")
            if not await self.confirm(proposal, before.measured, after.measured):
                raise GateRefused("the operator did not confirm")
            self._stage("store", "into memory that survives a power cycle")
            self._stored = True
            kept_set = await keep(self.station, wanted)
            self._stage("reload", "loaded again and read back bit for bit")
        except (Exception, asyncio.CancelledError) as error:
            await self._restore(snapshot, error)
            raise
        kept = snapshots.save(kept_set, f"applied {Path(self.fit.source).name}")
        snapshots.expect(kept_set)
        self._stage("done", f"kept as set {kept.number}; the way back: undo --to {snapshot.number}")
        applied = Applied(
            snapshot, kept, proposal, before.measured, after.measured, after.noise_peak_um
        )
        self._remember(applied)
        return applied

    def _remember(self, applied: Applied) -> None:
        """Add what was stored to the history; the set is in the controller, whatever comes here."""
        try:
            History(self.root).add(applied_entry(self.station.site, self.fit, applied))
        except BadInput as error:
            self._stage("done", f"it is not in the history: {error}")

    async def stop(self) -> None:
        """Stop a measurement of check poses; :meth:`run` then restores and ends."""
        self._stopping = True
        if self.running is not None:
            await self.running.stop()

    async def _measure(self, when: str, expected: Mapping[str, float]) -> Verification:
        """Measure the check poses with the parameters that the controller holds now."""
        site = self.station.site
        self._stage("verify", f"check poses {when} writing")
        options = PlanOptions(
            order=order_for(site),
            warm_up=False,
            two_face=False,
            title=f"check poses {when} writing",
        )
        plan = measure_plan(site, self.poses or check_poses(self.station), options, "check")
        session = Session.create(
            site,
            plan,
            self.root,
            station=self.station,
            unattended=self.unattended,
            expected=expected,
        )
        self.running = session
        try:
            await session.run()
            return judge(site, plan, session.journal)
        finally:
            self.running = None
            session.journal.close()

    async def _restore(self, snapshot: Snapshot, why: BaseException) -> None:
        """Bring the earlier set back after a failure; a second failure latches "unknown"."""
        self._stopping = False
        reason = str(why) or "stopped by the operator"
        self._stage("restore", f"set {snapshot.number} is to come back, because: {reason}")
        try:
            await asyncio.shield(_put_back(self.station, snapshot, stored=self._stored))
        except (DeviceError, OSError) as again:
            reason = f"restoring set {snapshot.number} failed: {again}"
            snapshots_of(self.station).latch_unknown(reason)
            self._stage("restore-failed", reason)
            raise ParameterError(
                f"its parameters are unknown. First: {why or 'stopped'}. Then: {reason}",
                device="controller",
                remedy=f"Do not move the machine. When it answers: pkmcal undo --to "
                f"{snapshot.number}",
            ) from why
        self._stage("restored", f"set {snapshot.number} is back, read back bit for bit")

    def _stage(self, stage: Stage, says: str) -> None:
        """Tell where we are, unless the operator wants to stop here."""
        if self._stopping:
            raise StoppedByOperator(f'stopped before "{stage}"')
        self.station.observers.tell(WriteBackStage(stage, says))


def applied_entry(site: Site, fit: SavedFit, applied: Applied) -> Entry:
    """What was stored, for the history."""
    kept, proposal = applied.kept, applied.proposal
    said = {
        "set": kept.number,
        "way_back": applied.snapshot.number,
        "checksum": kept.checksum,
        "held": len(kept.values),
        "runs": list(fit.runs),
        "effects": list(fit.effects),
        "parameters": [vars(change) for change in proposal.changes],
        "left_out": dict(proposal.left_out),
        "given_up": list(proposal.given_up),
        "check_before": vars(applied.before),
        "check_after": vars(applied.after),
        "noise_peak_um": applied.noise_peak_um,
    }
    machine, serial = site.machine.name, kept.identity.serial
    return Entry("applied", kept.taken_utc, machine, serial, fit.source, said)


def judged(
    site: Site,
    gates: Gates,
    fit: SavedFit,
    held: Held,
    serial: str = "",
    frame: Mapping[str, str] | None = None,
) -> tuple[Proposal, list[GateChecked]]:
    """What a fit would change in what the controller holds, and every gate before writing.

    ``serial`` is that of the controller that answers, ``frame`` what its poses refer to.

    Raises
    ------
    GateRefused
        If the controller holds the fit's values already.
    """
    machine, hosted = site.machine, site.controller.hosted
    proposal = propose(machine, fit, held.values, hosted=hosted)
    if not proposal.changes_something:
        raise GateRefused(
            "the controller holds this fit already",
            remedy="There is nothing to write; measure the machine again to see how good it is",
            gates=("gain",),
        )
    sets = None
    if hosted and all(math.isfinite(value) for value in proposal.values.values()):
        old = ParameterSet(held.values, held.own)
        new = ParameterSet(proposal.over(held.values), proposal.own)
        sets = HostedSets(*(one.identified(machine, site.load) for one in (old, new)))
    return proposal, gates_of_proposal(
        gates, machine, fit, proposal, held.values, sets, serial, frame
    )


async def _put_back(station: Station, snapshot: Snapshot, *, stored: bool) -> None:
    """Write a snapshot back; for good as well, if the new set may have been stored.

    A controller that refuses to store has perhaps refused the new set, too: then what it has
    stored is loaded, and must be the snapshot.
    """
    await station.safe_stop()
    wanted = Wanted(snapshot.values, snapshot.own)
    await write_volatile(station, wanted)
    if not stored:
        return
    try:
        await keep(station, wanted)
    except Refused:
        await station.controller.reload_parameters()
        await prove(station, wanted, "as it is stored")


async def undo(station: Station, snapshot: Snapshot, why: str) -> Snapshot:
    """Bring an earlier set back, for good; returns the set as it is now kept.

    What the controller holds is saved first, where it can be read at all. Clears the latch of
    unknown parameters.

    Raises
    ------
    ParameterError
        If the set does not read back; the parameters are then unknown, and motion blocked.
    """
    snapshots = snapshots_of(station)
    tell = station.observers.tell
    try:
        now = await prove(station, None, "before undoing")
        saved = snapshots.save(now, f"before {why}")
        tell(WriteBackStage("snapshot", f"what it holds now is set {saved.number}"))
    except ParameterError as error:
        tell(WriteBackStage("snapshot", f"what it holds cannot be saved: {error.what}"))
    try:
        tell(WriteBackStage("write", f"set {snapshot.number} into volatile memory"))
        wanted = Wanted(snapshot.values, snapshot.own)
        await write_volatile(station, wanted)
        tell(WriteBackStage("store", "into memory that survives a power cycle"))
        kept = await keep(station, wanted)
    except DeviceError as error:
        snapshots.latch_unknown(f"undo to set {snapshot.number} failed: {error.what}")
        raise
    snapshots.expect(kept)
    tell(WriteBackStage("done", f"set {snapshot.number} is back, read back bit for bit"))
    return snapshot


async def accept(station: Station) -> Snapshot:
    """Take what the controller holds as known, knowingly."""
    snapshots = snapshots_of(station)
    held = await prove(station, None, "to accept it")
    saved = snapshots.save(held, "accepted as it was found")
    snapshots.expect(held)
    return saved


def check_poses(station: Station) -> dict[str, Pose]:
    """Eight poses of the verification grid, spread over nodes and orientations."""
    grid = verification_poses(station.site.machine).by_label
    labels = list(grid)
    stride = max(len(labels) // CHECK_POSES, 1)
    chosen = [labels[k * stride + k % stride] for k in range(min(CHECK_POSES, len(labels)))]
    return {label: grid[label] for label in chosen}
