"""Monte-Carlo studies of machines within their tolerances, shared among processes or Dask workers.

A share is some machines, each drawn by a seed of its own: what is found hangs neither on how they
are shared nor on who answers.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.jobs.record import Record
from app.spread import spread
from calib.analysis.observation import Sights
from calib.analysis.trials import Calibrated, Errors, Seed, calibrated, uncalibrated
from calib.arrays import Array
from calib.errors import BadInput
from calib.poses.reach import PoseSet

SHARE = 50
"""Machines of one question."""
QUANTILES = {"median": 0.5, "p95": 0.95, "largest": 1.0}

Watch = Callable[[int, int], None]
"""Told how many of how many shares are answered."""


@dataclass(frozen=True, kw_only=True)
class DrawnEntry(Record):
    """Machines drawn within their tolerances: median, 95 % and largest of their errors.

    RMS of position and orientation over the poses, and the largest error of the position at one of
    them; um and mdeg. ``not_closing`` machines cannot take all of the poses and are not counted.
    """

    machines: int
    not_closing: int
    position_rms_um: Mapping[str, float]
    orientation_rms_mdeg: Mapping[str, float]
    position_largest_um: Mapping[str, float]


@dataclass(frozen=True, kw_only=True)
class CalibratedEntry(DrawnEntry):
    """The same of what a calibration leaves at fresh poses.

    ``within_1_sigma`` is the part of all parameters that came within their predicted standard
    uncertainty of the truth: 0.68 is wanted.
    """

    within_1_sigma: float


@dataclass(frozen=True, eq=False)
class _Question:
    """Some machines: where they are looked at and, if they are calibrated, what is read where."""

    fresh: PoseSet
    draws: tuple[Seed, ...]
    poses: PoseSet | None = None
    sights: Sights | None = None


def answer_for(asked: _Question) -> Errors | Calibrated:
    """Do one share."""
    if asked.poses is None or asked.sights is None:
        return uncalibrated(asked.fresh, asked.draws)
    return calibrated(asked.poses, asked.fresh, asked.sights, asked.draws)


def drawn_errors(
    fresh: PoseSet,
    machines: int,
    seed: int,
    workers: int | None,
    scheduler: str,
    watch: Watch | None,
) -> dict[str, Any]:
    """Machines that nobody has calibrated, as :class:`DrawnEntry`; BadInput if none closes."""
    asked = [_Question(fresh, draws) for draws in _shares(machines, seed)]
    found = _answers(asked, workers, scheduler, watch)
    return _said(Errors.joined([one for one in found if isinstance(one, Errors)]))


def drawn_calibrations(
    poses: PoseSet,
    fresh: PoseSet,
    sights: Sights,
    machines: int,
    seed: int,
    workers: int | None,
    scheduler: str,
    watch: Watch | None,
) -> dict[str, Any]:
    """The same machines calibrated, as :class:`CalibratedEntry`; BadInput if none closes."""
    asked = [_Question(fresh, draws, poses, sights) for draws in _shares(machines, seed)]
    answers = _answers(asked, workers, scheduler, watch)
    found = Calibrated.joined([one for one in answers if isinstance(one, Calibrated)])
    own = found.pulls[: poses.machine.nominal.size]
    return {
        **_said(found.errors),
        "within_1_sigma": float(np.mean(np.abs(own[np.isfinite(own)]) < 1.0)),
    }


def _shares(machines: int, seed: int) -> list[tuple[Seed, ...]]:
    draws = [(seed, number) for number in range(machines)]
    return [tuple(draws[first : first + SHARE]) for first in range(0, machines, SHARE)]


def _answers(
    asked: Sequence[_Question], workers: int | None, scheduler: str, watch: Watch | None
) -> list[Errors | Calibrated]:
    """In the order of the questions."""
    found: dict[int, Errors | Calibrated] = {}
    for number, one in spread(answer_for, asked, workers=workers, scheduler=scheduler):
        found[number] = one
        if watch is not None:
            watch(len(found), len(asked))
    return [found[number] for number in range(len(asked))]


def _said(found: Errors) -> dict[str, Any]:
    good = np.isfinite(found.position)
    if not good.any():
        raise BadInput(
            f"none of {good.size} machines within the tolerances can take all of the poses",
            remedy="Ask for fewer poses, or narrow [workspace] or tolerances in the machine file",
        )

    def quantiles(values: Array, factor: float) -> dict[str, float]:
        return {name: factor * float(np.quantile(values[good], q)) for name, q in QUANTILES.items()}

    return {
        "machines": int(good.sum()),
        "not_closing": int((~good).sum()),
        "position_rms_um": quantiles(found.position, 1e3),
        "orientation_rms_mdeg": quantiles(np.rad2deg(found.orientation), 1e3),
        "position_largest_um": quantiles(found.largest, 1e3),
    }
