"""After the beam was lost, the room was too warm, or a process was killed: is all as before?"""

import numpy as np

from app.errors import StoppedByOperator
from app.session.routines.beam import measured
from app.session.work import StartOver, Work

_LOOK_S = 1.0


async def reverify(work: Work) -> None:
    """Read the last good reference again and compare.

    With SMRs that stay on the base, the first of them is read. Otherwise nothing but the nest
    itself can be seen, and the reading that follows is judged by its predicted place alone. If
    the reference moved farther than the drift limit, base or tracker stand elsewhere: all readings
    are set aside (they stay in the journal) and taken again from the new stand.

    Raises
    ------
    StartOver
        After the readings were set aside.
    StoppedByOperator
        If that is the operator's answer.
    """
    work.memory.verified = True
    last = work.last_references()
    if not (work.site.hands.base_smrs and last):
        return
    reference = next(iter(last))
    reading, _ = await measured(work, reference, _LOOK_S)
    before = np.array(last[reference])
    shift = float(np.linalg.norm(np.array(reading.xyz) - before))
    work.memory.aimed_at = ""
    if shift <= work.limits.drift_mm:
        work.note("reverified", f"{reference} moved {1e3 * shift:.1f} um")
        return
    what = f"reference {reference} moved {1e3 * shift:.0f} um since it was last read"
    remedy = "Whatever was read before belongs to another stand of the tracker"
    work.alarm("reference", what, remedy)
    choice = await work.ask(f"{what}. {remedy}.", ("all again", "keep", "stop"), "all again")
    if choice == "stop":
        raise StoppedByOperator(what)
    if choice == "all again":
        work.start_over(what)
        raise StartOver(what)
