"""SMRs and nests: who is where, and is it true?"""

import numpy as np

from app.files.pose_table import HOME
from app.session.plan import Step
from app.session.routines.beam import measured
from app.session.routines.moving import ensure_at
from app.session.rows import NewRow
from app.session.work import Done, Work
from calib.arrays import Array
from drivers.errors import BeamBroken, NoTarget

_LOOK_S = 0.5
"""Dwell of a look that only asks which nest it is, s."""
TRIES = 3
BEHIND_MM, BESIDE_MM = 50.0, 30.0
"""How much nearer than a nest, and how near its line of sight, an SMR is that stands in the way."""


async def carry(work: Work, step: Step) -> Done:
    """Have an SMR brought to a nest."""
    await bring(work, step.args["smr"], step.args["nest"])
    return Done(f"SMR {step.args['smr']} said to be in nest {step.args['nest']}")


async def bring(work: Work, smr: int, nest: str, why: str = "") -> None:
    """Have an SMR carried, and remember where it is believed to be."""

    async def ask(text: str, choices: tuple[str, ...]) -> str:
        return await work.ask(text, choices)

    await work.station.carrier.carry(smr, nest, ask, why)
    work.smr_brought(smr, nest)
    work.memory.aimed_at = ""


async def ensure_smr(work: Work, nest: str) -> None:
    """Let a nest be occupied, as far as we know; the reading itself proves it."""
    if nest in work.site.base_nests and work.site.hands.base_smrs:
        return
    if nest not in work.smr_in.values():
        nests = list(work.site.platform_nests)
        own = nests.index(nest) + 1 if nest in nests else 1
        await bring(work, own if own <= work.site.hands.smrs else 1, nest)


async def confirm(work: Work, step: Step) -> Done:
    """Look whether the SMR is in the hole that it should be in; if not, have it carried again."""
    nest = step.args["nest"]
    for attempt in range(1, TRIES + 1):
        await ensure_at(work, HOME)
        await ensure_smr(work, nest)
        wrong = await _look(work, nest)
        if not wrong:
            return Done(f"nest {nest} it is", {"attempts": attempt})
        work.alarm(f"nest {nest}", wrong, f"Put the SMR into nest {nest}")
        await again(work, nest, wrong)
    raise wrong_hole(nest, wrong)


def wrong_hole(nest: str, what: str) -> NoTarget:
    """What is said when a nest stays wrong."""
    return NoTarget(
        f"nest {nest}: {what}, {TRIES} times",
        device="tracker",
        remedy=f"Put the SMR into nest {nest} and clear the line of sight, then go on",
    )


async def again(work: Work, nest: str, why: str) -> None:
    """Have the SMR of a nest put right."""
    smr = next((s for s, n in work.smr_in.items() if n == nest), 1)
    await bring(work, smr, nest, why)


async def _look(work: Work, nest: str) -> str:
    """Return what is wrong with the SMR in a nest, or nothing."""
    try:
        reading, _ = await measured(work, nest, _LOOK_S, patient=False)
    except (NoTarget, BeamBroken) as nothing:
        return f"no SMR is seen there ({nothing.what})"
    return misplaced(work, nest, HOME, np.array(reading.xyz))


def misplaced(work: Work, nest: str, label: str, xyz: Array) -> str:
    """Judge a reading by where it is: empty if the nest is right, else what the tracker saw.

    Every nest's place is predicted from the commanded pose; the radius is much larger than the
    machine's errors and much smaller than the distance between nests.
    """
    allowed = work.limits.hole_radius_mm
    if not work.memory.frame_found:
        allowed += work.site.tracker.frame_radius_mm
    nests = (*work.site.platform_nests, *work.site.base_nests)
    distance = {name: float(np.linalg.norm(xyz - work.predict(name, label))) for name in nests}
    nearest = min(distance, key=distance.__getitem__)
    if distance[nest] <= allowed and nearest == nest:
        return ""
    if distance[nearest] <= allowed:
        return f"the tracker sees nest {nearest} where nest {nest} was expected"
    other = in_the_way(work, nest, label, xyz)
    return other or f"the SMR is {distance[nest]:.2f} mm from nest {nest} and in no other nest"


def in_the_way(work: Work, nest: str, label: str, xyz: Array) -> str:
    """Say that a reading is of another SMR on the line of sight to a nest; empty if it is not."""
    wanted = work.predict(nest, label)
    away = float(np.linalg.norm(wanted))
    along = float(xyz @ wanted) / away
    beside = float(np.linalg.norm(xyz - along * wanted / away))
    if not BEHIND_MM < along < away - BEHIND_MM or beside > BESIDE_MM:
        return ""
    return (
        f"an SMR {np.linalg.norm(xyz):.0f} mm from the tracker stands in the line of sight to "
        f"nest {nest}, which is {away:.0f} mm away"
    )


def rejected_row(
    work: Work, label: str, nest: str, xyz: tuple[float, float, float], why: str
) -> NewRow:
    """A reading that is set aside: it stays in the journal and is not exported."""
    return NewRow(
        "reading", work.clock.now(), label, work.memory.q, nest, xyz, status="rejected", why=why
    )
