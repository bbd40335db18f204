"""The base: where it stands in the tracker's frame, whether it moved, and the two faces."""

from collections.abc import Mapping

import numpy as np

from app.files.pose_table import HOME
from app.session.events import DriftChecked, FrameFound
from app.session.plan import Step
from app.session.routines.beam import measured
from app.session.routines.carrying import ensure_smr, in_the_way, rejected_row
from app.session.routines.conditions import channels
from app.session.routines.moving import ensure_at
from app.session.routines.reading import reading_row, reading_taken
from app.session.work import Done, Work
from calib.arrays import Array
from calib.frames import exchanged, fit_frame, odd_one
from drivers.errors import NotReady


async def reference(work: Work, step: Step) -> Done:
    """Read one nest on the base."""
    nest = step.args["nest"]
    await ensure_smr(work, nest)
    if work.memory.standing_at is None:
        await ensure_at(work, HOME)
    reading, begun = await measured(work, nest, work.limits.dwell_s)
    miss = float(np.linalg.norm(np.array(reading.xyz) - work.predict(nest, HOME)))
    allowed = work.limits.hole_radius_mm
    if not work.memory.frame_found:
        allowed += work.site.tracker.frame_radius_mm
    if miss > allowed:
        other = in_the_way(work, nest, HOME, np.array(reading.xyz))
        why = other or f"{miss:.1f} mm from where nest {nest} should be"
        work.set_aside(rejected_row(work, "", nest, reading.xyz, why))
        hidden = (
            "Take it away, or turn or move the tracker (an SMR that near is often that of its "
            "own birdbath) and state its new frame in the site file"
        )
        seen = "Check the SMR in that nest and the tracker's frame in the site file"
        raise NotReady(
            f"reference {nest}: {why}", device="tracker", remedy=hidden if other else seen
        )
    row = reading_row(work, reading, begun, "", nest, await channels(work))
    says = f"{nest} read, {miss:.3f} mm from its predicted place"
    return Done(says, {"nest": nest}, row, (reading_taken(work, row),))


async def drift(work: Work, step: Step) -> Done:
    """Fit the base to its nests: find it the first time, judge its drift every other time."""
    last = work.last_references()
    nests = [nest for nest in step.args["nests"] if nest in last]
    if len(nests) < 3:
        raise NotReady(
            f"only {len(nests)} base nests were read; three are needed",
            device="reference",
            remedy="Go on and do not skip the reference nests",
        )
    drawn = {nest: np.array(work.site.base_nests[nest]) for nest in nests}
    seen = {nest: np.array(last[nest]) for nest in nests}
    frame, rms = fit_frame(_stack(drawn, nests), _stack(seen, nests))
    if rms > work.limits.base_fit_mm:
        raise _misfit(drawn, seen, rms, work.limits.base_fit_mm)
    found = FrameFound(frame.numbers(), rms, tuple(nests))
    if not work.memory.frame_found:
        work.memory.frame, work.memory.frame_found = frame, True
        says = f"base found, {1e3 * rms:.1f} um RMS over {len(nests)} nests"
        return Done(says, {"rms_mm": rms}, news=(found,))
    first, _ = fit_frame(_stack(drawn, nests), _stack(work.first_references(), nests))
    at_home = np.array(work.site.machine.home[:3])
    shift = float(np.linalg.norm(frame.apply(at_home) - first.apply(at_home)))
    limit = work.limits.drift_mm
    checked = DriftChecked(shift, limit, work.clock.now())
    if shift > limit:
        work.alarm(
            "drift",
            f"the base moved {1e3 * shift:.0f} um since the first reference (limit "
            f"{1e3 * limit:.0f})",
            "The run goes on; fit it with the tracker-drift effect, or measure again",
        )
    work.memory.frame = frame
    says = f"base moved {1e3 * shift:.1f} um"
    return Done(says, {"shift_mm": shift, "rms_mm": rms}, news=(found, checked))


def _stack(points: Mapping[str, Array | tuple[float, ...]], nests: list[str]) -> Array:
    """Points of the nests, (3, N)."""
    return np.stack([np.asarray(points[nest], float) for nest in nests], axis=1)


def _misfit(drawn: dict[str, Array], seen: dict[str, Array], rms: float, limit: float) -> NotReady:
    """Say why the base nests do not fit their drawing."""
    swapped = exchanged(drawn, seen, rms, limit) if len(seen) <= 6 else {}
    if not swapped and (odd := odd_one(drawn, seen, limit)):
        what = (
            f"nest {odd} on the base is off: the others fit their drawing, with it they miss it by "
            f"{rms:.3f} mm RMS"
        )
        remedy = f"Re-seat the SMR in {odd}; check that SMR's size and {odd} in [nests.base]"
    elif swapped:
        pairs = ", ".join(f"{a} is really {b}" for a, b in swapped.items())
        what, remedy = f"base nests were exchanged: {pairs}", "Correct the site file's nests"
    else:
        what = f"the base nests miss their drawing by {rms:.3f} mm RMS"
        remedy = "Re-seat the SMRs on the base and check [nests.base] in the site file"
    return NotReady(what, device="reference", remedy=remedy)


async def two_face(work: Work, step: Step) -> Done:
    """Read one base nest with both faces of the tracker; half the difference is its error."""
    if not work.tracker.can.faces:
        return Done("not done: this tracker has no two faces")
    nest = next(iter(work.site.base_nests))
    await ensure_smr(work, nest)
    one, _ = await measured(work, nest, 1.0)
    await work.tracker.change_face()
    two, _ = await measured(work, nest, 1.0)
    await work.tracker.change_face()
    work.memory.aimed_at = ""
    error = 0.5 * float(np.linalg.norm(np.array(one.xyz) - np.array(two.xyz)))
    limit = work.limits.two_face_mm
    if error > limit:
        work.alarm(
            "tracker",
            f"two-face error {1e3 * error:.0f} um (limit {1e3 * limit:.0f})",
            "Run the tracker's own compensation before you trust it",
        )
    return Done(f"two-face error {1e3 * error:.1f} um", {"error_mm": error})
