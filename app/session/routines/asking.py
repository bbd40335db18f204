"""The number of a gauge: until it rests, until it is one, until nobody doubts it."""

import asyncio
from dataclasses import dataclass

from app.doubt import doubt
from app.errors import StoppedByOperator
from app.files.site_gauge import GaugeSite
from app.session.events import LiveScatter
from app.session.gauge_rows import GAUGE, before
from app.session.rows import NewRow
from app.session.work import LeftOut, Work
from drivers.errors import DeviceError, MeasurementError, NoNumber, NotReady, Silence
from drivers.interface import GaugeReading
from drivers.lines.number import UNITS
from drivers.operator.gauge import PersonReads

TRIES = 3
"""How often a gauge is read by itself before somebody is asked."""
RESTS = 3
"""Readings in a row that agree before it is believed to rest."""
SPARE_S = 5.0
"""Wall seconds beyond the gauge's own time after which resting is given up."""
AGAIN, KEEP, LEAVE, STOP = "read again", "keep", "leave out", "stop"


@dataclass(frozen=True)
class About:
    """Which number it is: in words, pose, nests, second pose; ``expected`` by the drawing."""

    where: str
    label: str
    nest: str
    nest2: str
    pose2: str
    expected: float


async def number(work: Work, own: GaugeSite, about: About) -> tuple[float, str]:
    """What is measured (mm or rad), and what was sent or typed for it.

    Raises
    ------
    MeasurementError, LinkError
        Where it shows no number, or one that cannot be, and nobody can be asked.
    LeftOut, StoppedByOperator
        As the operator says.
    """
    tries = 0
    while True:
        tries += 1
        try:
            reading = await _rested(work, own, about)
            if not own.lowest <= reading.value <= own.highest:
                raise NoNumber(
                    f"it shows {reading.said}, it can show {own.lowest:g} to {own.highest:g}",
                    device="gauge", remedy="See where the surface is; lowest, highest in the site",
                )  # fmt: skip
        except (MeasurementError, Silence) as none:
            if isinstance(none, Silence):
                work.station.check()
            await without(work, about, none, tries)
            continue
        value = own.zero_at + own.sign * reading.value
        kept = await _judged(work, own, about, value, reading.said, tries)
        if kept is not None:
            return kept, reading.said


async def _rested(work: Work, own: GaugeSite, about: About) -> GaugeReading:
    """One that is typed or made by a key; else the mean of several in a row that agree."""
    gauge, limits = work.gauge, work.limits
    if isinstance(gauge, PersonReads):
        gauge.ask = _typed(work, about)
    if not gauge.can.repeats:
        return await gauge.read(limits.dwell_s)
    loop, without = asyncio.get_running_loop(), 0
    end = loop.time() + work.clock.to_wall(limits.settle_timeout_s) + SPARE_S
    seen: list[GaugeReading] = []
    while loop.time() <= end:
        try:
            seen.append(await gauge.read(limits.settle_window_s))
        except NoNumber:
            without += 1
            if without >= TRIES:
                raise
            await asyncio.sleep(work.clock.to_wall(limits.settle_window_s))
            continue
        without = 0
        last = [one.value for one in seen[-RESTS:]]
        spread = max(last) - min(last)
        rests = len(last) == RESTS and spread <= 2.0 * own.sigma
        if own.unit == "mm":
            work.tell(LiveScatter(spread, 2.0 * own.sigma, (0.0, 0.0, last[-1]), rests))
        if rests:
            return GaugeReading(sum(last) / RESTS, seen[-1].said)
        await asyncio.sleep(work.clock.to_wall(limits.settle_window_s))
    raise NotReady(
        f"{RESTS} numbers in a row do not agree to {2.0 * own.sigma:g} {own.unit} within "
        f"{limits.settle_timeout_s:g} s",
        device="gauge",
        remedy="Look for vibration or a loose stand, or state a larger sigma in the site file",
    )


def _typed(work: Work, about: About):  # type: ignore[no-untyped-def]
    async def ask(wrong: str, typed: str) -> str:
        text = f"{wrong}{about.where[:1].upper()}{about.where[1:]}: what does the gauge show?"
        answer = await work.ask(text, (LEAVE, STOP), None, typed=typed)
        leave_or_stop(answer, about)
        return answer

    return ask


def leave_or_stop(answer: str, about: About) -> None:
    """End the step where the operator wants that; raises LeftOut, StoppedByOperator."""
    if answer == STOP:
        raise StoppedByOperator(f"stopped at {about.where}")
    if answer == LEAVE:
        raise LeftOut(f"{about.where} was left out by the operator")


async def without(work: Work, about: About, none: DeviceError, tries: int) -> None:
    """There is no number: again, then ask; raises ``none`` where nobody can be asked."""
    work.alarm("gauge", f"{about.where}: {none.what}", none.remedy)
    if tries == 1 and isinstance(none, Silence) and work.gauge.can.repeats:
        return  # one answer may get lost
    answer = await work.ask(
        f"The gauge shows no number at {about.where}: {none.what}.",
        (AGAIN, LEAVE, STOP),
        None,
        none,
    )
    leave_or_stop(answer, about)


async def _judged(
    work: Work, own: GaugeSite, about: About, value: float, said: str, tries: int
) -> float | None:
    """The value that is to be kept; None: read it again."""
    typed = work.gauge.can.by_hand
    found = doubt(
        said.split()[0] if typed else "", value, about.expected, before(work.journal), own.near,
        own.own_zero, lambda text: _of_text(work, own, text),
    )  # fmt: skip
    behind = own.reads != "tilt" and own.instrument.zero_sigma is None and value <= 0.0
    if behind and (own.plane or own.reads == "distance"):
        says, meant, how = f"{value:g} mm: not larger than zero", None, ""
    elif found is None:
        return value
    else:
        says, meant, how = found.says, found.meant, found.how
    probably = f"; {meant:.6g} {own.unit} was probably meant ({how})" if meant is not None else ""
    why = f"{said}: {says}{probably}"
    if tries < TRIES and work.gauge.can.repeats:
        await asyncio.sleep(work.clock.to_wall(work.limits.settle_window_s))
        return None
    raw = {GAUGE: {"kind": own.reads, "value": value, "said": said, "expected": about.expected}}
    row = NewRow(
        "reading", work.clock.now(), about.label, work.memory.q, about.nest, status="rejected",
        why=why, raw=raw,
    )  # fmt: skip
    work.set_aside(row)
    fault = NotReady(
        f"{about.where}: {why}", device="gauge",
        remedy="See unit, zero_at and sign in the site file, whether the gauge is held, and near "
        "if the machine may be off so far",
    )  # fmt: skip
    take = (f"take {meant:.6g}",) if meant is not None and typed else ()
    keep = () if behind and found is None else (KEEP,)
    answer = await work.ask(
        f"At {about.where} the gauge shows {why}.", (AGAIN, *take, *keep, LEAVE, STOP), None, fault
    )
    leave_or_stop(answer, about)
    if answer == KEEP:
        return value
    return meant if take and answer == take[0] else None


def _of_text(work: Work, own: GaugeSite, text: str) -> float | None:
    """What was measured if this was typed."""
    try:
        return own.zero_at + own.sign * UNITS[own.settings["unit"]] * float(text.replace(",", "."))
    except ValueError:
        return None
