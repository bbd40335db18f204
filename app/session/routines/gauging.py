"""One number: the gauge is brought there, rests, is read, doubted where the machine contradicts."""

from app.errors import StoppedByOperator
from app.files.site_gauge import GaugeSite
from app.session.events import DriftChecked, NumberTaken
from app.session.gauge_rows import GAUGE, before, last_said, numbers
from app.session.plan import Step
from app.session.routines.asking import About, number
from app.session.routines.following import alive
from app.session.routines.moving import ensure_at, go
from app.session.routines.reading import in_band
from app.session.rows import NewRow
from app.session.spans import along, between
from app.session.work import Done, Work
from calib.digits import plus_minus
from drivers.errors import NoNumber, NotReady

OFF = ("", "")


async def gauge(work: Work, step: Step) -> Done:
    """Hear it once, where it can be asked; raises DeviceError where nothing comes."""
    work.memory.spanned = None if before(work.journal) else OFF
    if not work.gauge.can.repeats:
        return Done(
            "typed in" if work.gauge.can.by_hand else "says something once a key is pressed"
        )
    try:
        reading = await work.gauge.read(work.limits.settle_window_s)
    except NoNumber as none:
        return Done(f"answers; {none.what}")
    return Done(f"answers: {reading.said}")


async def touch(work: Work, step: Step) -> Done:
    """Read a place, or a pair of nests, at a pose.

    Raises
    ------
    DeviceError
        If the gauge says nothing, no number, or one that cannot be, and nobody can be asked.
    LeftOut
        Where the operator leaves the place out.
    """
    own, label, args = own_gauge(work), step.args["pose"], step.args
    told = await in_band(work)
    pair = (args["nest"], args["nest2"]) if args.get("nest2") else None
    if pair is not None:
        await _span(work, label, pair, stays=args["stays"])
    elif work.memory.standing_at != label:
        if args.get("above"):
            await ensure_at(work, args["above"])
        await go(work, label)
    pose = work.pose(label)
    expected = (
        along(work.site, own, pose) if pair is None else between(work.site, (pose, pose), pair)
    )
    about = About(_where(step), label, args["nest"], args.get("nest2", ""), "", expected)
    value, said = await number(work, own, about)
    if said == last_said(work.journal) and args.get("above") and work.gauge.can.repeats:
        await alive(work, own, label)
        value, said = await number(work, own, about)
    again = bool(args.get("again"))
    return taken_down(work, own, about, (value, said), told, args.get("cycle"), again)


async def mark(work: Work, step: Step) -> Done:
    """Leave a mark with the tool at a pose."""
    label = step.args["pose"]
    await ensure_at(work, label)
    text = f"Leave mark {label} where the tool stands, and say when it is there."
    if await work.ask(text, ("done", "stop")) == "stop":
        raise StoppedByOperator(f"stopped when mark {label} was to be left")
    return Done(f"mark {label} is there")


async def between_marks(work: Work, step: Step) -> Done:
    """Read the distance between two marks that were left."""
    own, args = own_gauge(work), step.args
    one, two = args["pose"], args["pose2"]
    nests = (args["nest"], args["nest2"])
    expected = between(work.site, (work.pose(one), work.pose(two)), nests)
    about = About(_where(step), one, args["nest"], args["nest2"], two, expected)
    return taken_down(work, own, about, await number(work, own, about), await in_band(work), None)


async def apart(work: Work, step: Step) -> Done:
    """Have the gauge taken off before the machine moves."""
    await take_off(work)
    return Done("it is off")


async def take_off(work: Work) -> None:
    """Have the gauge taken off, unless it is known to be."""
    if work.memory.spanned != OFF:
        await work.station.carrier.take_off(work.ask)
        work.memory.spanned = OFF


async def _span(work: Work, label: str, pair: tuple[str, str], *, stays: bool) -> None:
    """Bring the machine to a pose, and have the gauge set between two nests."""
    memory = work.memory
    if memory.standing_at != label:
        if not (stays and memory.spanned == pair):
            await take_off(work)
        await ensure_at(work, label)
    if memory.spanned != pair:
        await work.station.carrier.span(*pair, work.ask)
        memory.spanned = pair


def own_gauge(work: Work) -> GaugeSite:
    """The site's gauge; raises NotReady where it has none."""
    if work.site.gauge is None:
        raise NotReady(
            "this site has no gauge", device="gauge", remedy="Go on with the site of the session"
        )
    return work.site.gauge


def _where(step: Step) -> str:
    args = step.args
    if args.get("pose2"):
        return f"marks {args['pose']} and {args['pose2']}"
    if args.get("nest2"):
        return f"pose {args['pose']}, {args['nest']} to {args['nest2']}"
    return f"place {args['pose']}"


def taken_down(
    work: Work, own: GaugeSite, about: About, read: tuple[float, str],
    told: dict[str, float], cycle: int | None, again: bool = False,
) -> Done:  # fmt: skip
    """The end of a reading: its row, and what is told of it."""
    value, said = read
    now = work.clock.now()
    memory = work.memory
    memory.delay_s = max(now - memory.arrived_s, 0.0)
    q = memory.q if not about.pose2 else work.journal.sent_to(about.label)
    row = NewRow(
        kind="reading", time_s=now, pose=about.label, q=q, nest=about.nest,
        delay_s=memory.delay_s, cycle=cycle, channels=told,
        raw={
            GAUGE: {
                "kind": own.reads, "value": value, "sigma": own.sigma, "nest2": about.nest2,
                "plane": own.plane, "pose2": about.pose2, "said": said, "expected": about.expected,
            }
        },
    )  # fmt: skip
    zero = own.zero_of(before(work.journal))
    taken = NumberTaken(
        work.journal.readings() + 1, about.label, about.nest, about.nest2, q, value,
        about.expected + zero, own.sigma, own.unit, now, told,
    )  # fmt: skip
    if again:
        _watch_zero(work, own, about, value)
    off, factor, unit = value - taken.expected, *SHOWN[own.unit]
    says = f"{about.where}: {plus_minus(factor * off, factor * own.sigma, unit)} from the drawing"
    return Done(says, {"nest": about.nest}, row, (taken,))


def _watch_zero(work: Work, own: GaugeSite, about: About, value: float) -> None:
    """A place that is read again: how far the gauge's zero, or the plate, has gone."""
    first = next((row for row in numbers(work.journal) if row.pose == about.label), None)
    if first is None or own.unit != "mm":
        return
    was = first.raw[GAUGE]
    shift = value - about.expected - (float(was["value"]) - float(was["expected"]))
    limit = work.limits.drift_mm
    work.tell(DriftChecked(abs(shift), limit, work.clock.now()))
    if abs(shift) > limit:
        work.alarm(
            "gauge", f"{about.where} reads {1e3 * shift:+.0f} um more than the first time (limit "
            f"{1e3 * limit:.0f})", "See whether gauge or plate have moved, and measure again",
        )  # fmt: skip


SHOWN = {"mm": (1000.0, "um"), "rad": (1000.0, "mrad")}
"""Factor and unit in which what a number is off by is told."""
