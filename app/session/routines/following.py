"""Does the gauge follow the machine? A little lift must show in its number, with its sign."""

import asyncio

from app.files.site_gauge import GaugeSite
from app.session.gauge_rows import GAUGE, last_said
from app.session.plan import Step
from app.session.routines.moving import ensure_at, go
from app.session.spans import along
from app.session.work import Done, Work
from drivers.errors import NoNumber, NotReady

RAISED = "^"
LIKE = 0.5
"""Part of the lift by which the change of the number may differ from it."""


async def follows(work: Work, step: Step) -> Done:
    """After the first place: raise the platform and compare; raises NotReady, in words."""
    own = work.site.gauge
    assert own is not None
    label = step.args["of"]
    rows = [row for row in work.journal.rows() if row.pose == label and GAUGE in row.raw]
    if not rows:
        return Done("not asked: the first place was left out")
    before = float(rows[-1].raw[GAUGE]["value"])
    await ensure_at(work, step.args["pose"])
    change = await _change(work, own, label, before)
    return Done(change)


async def alive(work: Work, own: GaugeSite, label: str) -> None:
    """A number came a second time: raise, see that it changes, come back."""
    rows = [row for row in work.journal.rows() if GAUGE in row.raw]
    said, before = last_said(work.journal), float(rows[-1].raw[GAUGE]["value"])
    await go(work, f"{label}{RAISED}")
    says = await _change(work, own, label, before)
    work.note("alive", f"{said} came twice; raised at {label}: {says}")
    await go(work, label)


async def _change(work: Work, own: GaugeSite, label: str, before: float) -> str:
    """How the number changed with the lift, in words.

    Raises
    ------
    NotReady
        If it did not, the other way, or by another amount: a held or stuck gauge, a sign, a unit.
    """
    lift = along(work.site, own, work.pose(f"{label}{RAISED}")) - along(
        work.site, own, work.pose(label)
    )
    await asyncio.sleep(work.clock.to_wall(work.limits.settle_window_s))
    try:
        reading = await work.gauge.read(work.limits.settle_window_s)
    except NoNumber:
        return f"raised by {lift:g} mm it shows none"
    change = own.zero_at + own.sign * reading.value - before
    if abs(change - lift) <= LIKE * abs(lift) + 5.0 * own.sigma:
        return f"raised by {lift:g} mm it changed by {change:.3f} mm"
    if abs(change) <= 5.0 * own.sigma:
        what = (
            f"it repeats its number ({reading.said}) although the platform was raised {lift:g} mm"
        )
        remedy = "See whether it is held or stuck, touches at all, and its battery"
    elif abs(change + lift) <= LIKE * abs(lift) + 5.0 * own.sigma:
        what = f"it counts the other way: raised by {lift:g} mm it changed by {change:.3f} mm"
        remedy = "Write the other sign in [gauge] of the site file, or turn it in its holder"
    else:
        inches = abs(change * 25.4 - lift) <= LIKE * abs(lift) or (
            abs(change / 25.4 - lift) <= LIKE * abs(lift)
        )
        what = f"raised by {lift:g} mm it changed by {change:.4g} mm"
        remedy = (
            "Millimetres and inches were exchanged: see unit in [gauge] and the gauge's own unit"
            if inches
            else "See unit in [gauge], and how the gauge is held"
        )
    raise NotReady(what, device="gauge", remedy=remedy)
