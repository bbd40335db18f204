"""A probe that only says whether it touches is lowered in steps until it does.

It comes from above, where it must be open; in large steps until it touches, up again until it is
open, then in steps of a tenth, down to the finest. The actuators' targets at the first touching
step of these are what the reading holds: the place is latched.
"""

import asyncio

from app.files.pose_table import Pose
from app.files.site_gauge import GaugeSite
from app.session.gauge_plans import LIFTED
from app.session.plan import Step
from app.session.routines.asking import (
    AGAIN,
    KEEP,
    LEAVE,
    STOP,
    TRIES,
    About,
    leave_or_stop,
    without,
)
from app.session.routines.gauging import own_gauge, taken_down
from app.session.routines.moving import approach, ensure_at
from app.session.routines.reading import in_band
from app.session.spans import along
from app.session.work import Done, Work
from drivers.errors import DeviceError, MeasurementError, NoNumber, NotReady, Silence
from drivers.interface import GaugeReading

SURE = 2
"""Times in a row that a probe must say that it touches: one may be a knock."""
ROUNDING = 1e-9


async def probe(work: Work, step: Step) -> Done:
    """Touch a plane at one place.

    Raises
    ------
    MeasurementError, LinkError
        Where it touches nothing, all the time, or far from the drawing, and nobody can be asked.
    LeftOut, StoppedByOperator
        As the operator says.
    """
    own, label, args = own_gauge(work), step.args["of"], step.args
    told, tries = await in_band(work), 0
    about = About(f"place {label}", label, args["nest"], "", "", own.zero_at)
    while True:
        tries += 1
        await ensure_at(work, f"{label}{LIFTED}")
        try:
            height, said = await Lowering(work, own, label, args["pose"]).latched()
        except (MeasurementError, Silence) as none:
            if isinstance(none, Silence):
                work.station.check()
            await without(work, about, none, tries)
            continue
        found = About(
            about.where, label, about.nest, "", "",
            along(work.site, own, _raised(work.pose(label), own, height)),
        )  # fmt: skip
        if await _believed(work, own, found):
            again = bool(args.get("again"))
            return taken_down(work, own, found, (own.zero_at, said), told, args.get("cycle"), again)


class Lowering:
    """One place is touched; ``label`` is its pose, ``deepest`` that of the lowest."""

    def __init__(self, work: Work, own: GaugeSite, label: str, deepest: str) -> None:
        assert own.search is not None
        self.work, self.own, self.search = work, own, own.search
        self.place, self.deepest = work.pose(label), deepest
        self.height = own.clearance_mm

    async def latched(self) -> tuple[float, str]:
        """Height over the place (mm, along the plane's normal) where it touches, and its words.

        Raises
        ------
        NotReady
            If it touches before it is lowered, touches nothing, or does not let go.
        MeasurementError, LinkError
            As reading raises them.
        """
        if (said := await self._touches()) is not None:
            raise NotReady(
                f"it says that it touches ({said}), {self.height:g} mm above the place",
                device="gauge", remedy="See whether it is held or stuck, and clearance_mm",
            )  # fmt: skip
        said = ""
        for number, step in enumerate(self.search.steps):
            if number:
                await self._let_go(self.search.steps[number - 1])
            said = await self._down(step)
        return self.height, said

    async def _down(self, step: float) -> str:
        """Lower it in steps until it touches."""
        while self.height - step >= -self.search.below_mm - ROUNDING:
            await self._to(self.height - step)
            if (said := await self._touches()) is not None:
                return said
        await self._to(self.own.clearance_mm)
        raise NotReady(
            f"it touched nothing down to {self.search.below_mm:g} mm below the place",
            device="gauge",
            remedy="See where the surface is, whether the probe is connected, and below_mm",
        )

    async def _let_go(self, step: float) -> None:
        """Lift it until it is open."""
        touched = self.height
        while self.height < self.own.clearance_mm - ROUNDING:
            await self._to(min(self.height + step, self.own.clearance_mm))
            if await self._touches() is None:
                return
        raise NotReady(
            f"it still says that it touches, lifted by {self.height - touched:.3g} mm",
            device="gauge", remedy="See whether it sticks",
        )  # fmt: skip

    async def _to(self, height: float) -> None:
        await approach(self.work, self.deepest, _raised(self.place, self.own, height))
        self.height = height

    async def _touches(self) -> str | None:
        """What it says of touching, as often as makes it sure; None where it is open."""
        await asyncio.sleep(self.work.clock.to_wall(self.work.limits.settle_window_s))
        for _ in range(SURE):
            reading = await self._heard()
            if reading.value < 0.5:
                return None
        return reading.said

    async def _heard(self) -> GaugeReading:
        for left in reversed(range(TRIES)):
            try:
                return await self.work.gauge.read(self.work.limits.settle_window_s)
            except NoNumber:
                if not left:
                    raise
        raise AssertionError


def _raised(pose: Pose, own: GaugeSite, height: float) -> Pose:
    """A pose moved along the normal of what is touched, mm."""
    x, y, z, rx, ry, rz = pose
    return x + own.away[0] * height, y + own.away[1] * height, z + own.away[2] * height, rx, ry, rz


async def _believed(work: Work, own: GaugeSite, about: About) -> bool:
    """Whether a contact is kept: one far from the drawing is asked about; False: touch again."""
    off = about.expected - own.zero_at
    if abs(off) <= own.near:
        return True
    what = f"{about.where} was touched {off:+.3g} mm from where the drawing has the surface"
    fault: DeviceError = NotReady(
        what, device="gauge",
        remedy="See what it touched; near in the site file if machine or plate may be off so far",
    )  # fmt: skip
    answer = await work.ask(
        f"{what[0].upper()}{what[1:]}.", (AGAIN, KEEP, LEAVE, STOP), None, fault
    )
    leave_or_stop(answer, about)
    return answer == KEEP
