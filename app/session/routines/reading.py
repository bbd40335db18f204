"""One reading: everything that it needs is made sure of, then settle, dwell, judge, write."""

import asyncio
import math

import numpy as np

from app.files.pose_table import HOME
from app.session.events import ReadingTaken
from app.session.plan import Step
from app.session.routines.beam import measured
from app.session.routines.carrying import (
    TRIES,
    again,
    ensure_smr,
    misplaced,
    rejected_row,
    wrong_hole,
)
from app.session.routines.conditions import channels
from app.session.routines.moving import ensure_at
from app.session.routines.reverifying import reverify
from app.session.routines.watching import watch
from app.session.rows import NewRow
from app.session.work import Done, Work
from drivers.errors import NotReady
from drivers.interface import TrackerReading

_BAND_MARGIN_K = 0.5
_BAND_LOOK_S = 30.0
_BAND_PATIENCE_S = 3600.0


async def read(work: Work, step: Step) -> Done:
    """Read one nest at one pose.

    A reading that is not where its nest is predicted is set aside with the reason, the SMR is put
    right, and the reading is taken again.

    Raises
    ------
    MeasurementError
        If the beam does not come back, or the SMR stays in a wrong hole.
    """
    nest, label = step.args["nest"], step.args["pose"]
    wrong = ""
    for _ in range(TRIES):
        state_channels = await in_band(work)
        await ensure_smr(work, nest)
        await ensure_at(work, label)
        reading, begun = await dwell(work, nest)
        wrong = misplaced(work, nest, label, np.array(reading.xyz))
        if not wrong:
            row = reading_row(work, reading, begun, label, nest, state_channels)
            row = _with_cycle(row, step.args.get("cycle"))
            watch(work, row)
            taken = reading_taken(work, row)
            says = (
                f"nest {nest}: {1e3 * taken.miss_mm:.0f} um from where the controller's model says"
            )
            return Done(says, {"nest": nest}, row, (taken,))
        work.set_aside(rejected_row(work, label, nest, reading.xyz, wrong))
        work.alarm(f"nest {nest}", wrong, f"Put the SMR back into nest {nest}")
        work.memory.aimed_at = ""
        await again(work, nest, wrong)
    raise wrong_hole(nest, wrong)


async def dwell(work: Work, nest: str) -> tuple[TrackerReading, float]:
    """Aim at a nest and measure; returns the reading and when its dwell began, machine s.

    After the beam was lost the last good reference is read again before going on.
    """
    lost_before = work.losses
    reading, begun = await measured(work, nest, work.limits.dwell_s)
    if work.losses > lost_before or not work.memory.verified:
        await reverify(work)
        reading, begun = await measured(work, nest, work.limits.dwell_s)
    return reading, begun


def reading_row(
    work: Work,
    reading: TrackerReading,
    begun: float,
    label: str,
    nest: str,
    state_channels: dict[str, float],
) -> NewRow:
    """Everything that a reading leaves in the journal."""
    work.memory.delay_s = max(begun - work.memory.arrived_s, 0.0)
    return NewRow(
        kind="reading",
        time_s=begun,
        pose=label,
        q=work.memory.q,
        nest=nest,
        xyz=reading.xyz,
        covariance=reading.covariance,
        delay_s=work.memory.delay_s,
        channels=state_channels,
        raw={
            "temperature_C": reading.temperature_C,
            "pressure_hPa": reading.pressure_hPa,
            "humidity": reading.humidity,
            "reflector": work.site.tracker.reflector,
        },
    )


def _with_cycle(row: NewRow, cycle: int | None) -> NewRow:
    return NewRow(**{**vars(row), "cycle": cycle})


def reading_taken(work: Work, row: NewRow) -> ReadingTaken:
    """What is to be told of a reading when it is in the journal."""
    assert row.xyz is not None
    assert row.covariance is not None
    x, y, z = (float(value) for value in work.predict(row.nest, row.pose or HOME))
    return ReadingTaken(
        number=work.journal.readings() + 1,
        pose_label=row.pose,
        nest=row.nest,
        q=row.q,
        xyz=row.xyz,
        predicted=(x, y, z),
        miss_mm=math.dist(row.xyz, (x, y, z)),
        sigma_mm=math.sqrt(sum(row.covariance[:3])),
        time_s=row.time_s,
        channels=row.channels or {},
    )


async def in_band(work: Work) -> dict[str, float]:
    """Read the channels; hold the job while the air is outside the site's band.

    Leaving the band suspends at once, coming back needs half a kelvin more.
    """
    low, high = work.limits.air_temp_C
    now = await channels(work)
    air = now.get("air_temp_C")
    if air is None or low <= air <= high:
        return now
    work.suspended(
        f"the air has {air:.1f} deg C, the site allows {low:g} to {high:g}",
        "Wait, or change air_temp_C in the site file",
    )
    begun = work.clock.now()
    while not low + _BAND_MARGIN_K <= air <= high - _BAND_MARGIN_K:
        if work.clock.now() - begun > _BAND_PATIENCE_S:
            raise NotReady(
                f"the air stays at {air:.1f} deg C", device="environment", remedy="Wait, then go on"
            )
        await asyncio.sleep(work.clock.to_wall(_BAND_LOOK_S))
        now = await channels(work)
        air = now.get("air_temp_C", air)
    work.released("the air is within the band again")
    work.memory.verified = False
    return now
