"""Readings are looked at as they come: what is wrong is heard at that pose, not after the run.

What no measurement can be is not taken (:func:`check_alive`); what may be a fault is told and
written down, and the reading is kept.
"""

import math
from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from app.files.pose_table import HOME
from app.session.rows import NewRow
from app.session.work import Work
from calib.look.temperatures import SENTINELS
from drivers.errors import NotReady
from drivers.interface import TrackerReading

_APART = 5.0
"""How many times the site's ``base_fit_mm`` two nests of one pose may be off their distance."""
_ELSEWHERE_MM = 0.1
"""Farther apart than this two places of an SMR have other coordinates, whatever the tracker."""
_ROOM_C = (-40.0, 100.0)
"""Outside of it a temperature is none of a machine or its room."""
_STANDS, _CHANCE = 8, 1e-6
"""Equal answers in a row before a sensor can be called stuck, and the chance of that at most."""
_VALUES = 6
"""How many values it told shortly before, at least."""


def check_alive(work: Work, nest: str, reading: TrackerReading) -> None:
    """Refuse what is no measurement: a place of exactly zero, and the last place once more.

    Raises
    ------
    NotReady
        If x, y and z are zero, or those of an SMR that was elsewhere, to the last digit.
    """
    if not any(reading.xyz):
        raise NotReady(
            "a reading of exactly 0, 0, 0: nothing was measured",
            device="tracker",
            remedy="See whether the tracker measures at all; initialise it anew",
        )
    seen = work.memory.seen
    predicted = tuple(float(v) for v in work.predict(nest, work.memory.standing_at or HOME))
    again = tuple(reading.xyz) == seen.xyz
    if again and math.dist(predicted, seen.predicted) > _ELSEWHERE_MM:
        raise NotReady(
            f"x, y, z at nest {nest} are those of the reading before (nest {seen.nest}, elsewhere) "
            "to the last digit: the tracker sent its last reading again",
            device="tracker",
            remedy="See whether the tracker goes on measuring; initialise it anew",
        )
    seen.nest, seen.predicted, seen.xyz = nest, predicted, tuple(reading.xyz)


def watch(work: Work, row: NewRow) -> None:
    """Tell the operator, and the journal, what looks wrong about a reading that was taken."""
    _watch_distance(work, row)
    _watch_thermometers(work, row.channels or {})


def _watch_distance(work: Work, row: NewRow) -> None:
    """Two nests of one visit are as far apart as on the drawing: the platform is rigid."""
    seen, nests = work.memory.seen, work.site.platform_nests
    arrived, before, xyz = seen.visit
    assert row.xyz is not None
    assert row.covariance is not None
    seen.visit = (work.memory.arrived_s, row.nest, row.xyz)
    if arrived != work.memory.arrived_s or before == row.nest or before not in nests:
        return
    apart, drawn = math.dist(row.xyz, xyz), math.dist(nests[row.nest], nests[before])
    sigma = math.sqrt(2.0 * sum(row.covariance[:3]))
    if abs(apart - drawn) > _APART * work.limits.base_fit_mm + 5.0 * sigma:
        pair = " and ".join(sorted((before, row.nest)))
        _tell_once(
            work,
            f"nests {pair}",
            f"read {apart - drawn:+.2f} mm farther apart than by the drawing ({drawn:.2f} mm) at "
            f"pose {row.pose or HOME}",
            "The tracker moved between the two, an SMR does not sit, or the nest table is wrong",
        )


def _watch_thermometers(work: Work, channels: Mapping[str, float]) -> None:
    """Values that no sensor means, and sensors that went on changing and then no longer did."""
    seen, asked = work.memory.seen, work.memory.channels[0]
    if asked == seen.asked_s:
        return
    seen.asked_s = asked
    for name, value in channels.items():
        if not name.endswith("temp_C"):
            continue
        if value in SENTINELS or not _ROOM_C[0] < value < _ROOM_C[1]:
            _tell_once(
                work, name, f"reads {value:g} deg C: a sensor that is not there, or another unit",
                "See the sensor and its link; what heat does is not found without it",
            )  # fmt: skip
            continue
        answers = seen.answers.setdefault(name, [])
        answers.append(value)
        if _stuck(answers):
            _tell_once(
                work, name, f"no longer changes: {value:g} deg C, {_still(answers)} answers on end",
                "See the sensor and its link; what heat does is not found without it",
            )  # fmt: skip


def _still(answers: list[float]) -> int:
    """How many answers at the end are the same."""
    return next((k for k, one in enumerate(reversed(answers)) if one != answers[-1]), len(answers))


def _stuck(answers: list[float]) -> bool:
    """Whether it is beyond chance that a sensor that used to change stands still."""
    still = _still(answers)
    before = answers[: len(answers) - still + 1][-max(still, _STANDS) - 1 :]
    # A sensor of few digits goes to and fro between two values, and rests on one for long.
    if still < _STANDS or len(set(before)) < _VALUES:
        return False
    rate = float(np.mean([a != b for a, b in pairwise(before)]))
    return (still - 1) * math.log1p(-min(rate, 0.999)) < math.log(_CHANCE)


def _tell_once(work: Work, what: str, says: str, remedy: str) -> None:
    """Raise an alarm, and not the same again at every pose that follows."""
    if what not in work.memory.seen.told:
        work.memory.seen.told.add(what)
        work.alarm(what, says, remedy)
