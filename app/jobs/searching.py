"""Searches for poses from several seeds, by processes or Dask workers; the best is kept."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from app.files.site import Site
from app.jobs.read_there import drawn_for
from app.spread import spread
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.mechanism.limits import Margin
from calib.poses.choose import Criterion
from calib.poses.design import FRESH, TABLE, Design, design_poses, misses
from calib.poses.reach import PoseSet, sample_poses
from calib.poses.readings import Readings


@dataclass(frozen=True, eq=False)
class Search:
    """What poses are sought, and by which seed."""

    machine: Machine
    site: Site | None
    readings: Readings
    count: int
    seed: int
    criterion: Criterion
    priors: bool
    candidates: int
    margin: Margin
    fresh: PoseSet | None = None
    """Where all searches are judged alike; None where there is one."""


@dataclass(frozen=True, eq=False)
class Sought:
    """A design, and how far off it leaves the platform; or why there is none."""

    design: Design | None
    miss: float = float("inf")
    why: BadInput | None = None


def search(asked: Search) -> Design:
    """Search once; raises BadInput."""
    return design_poses(
        asked.machine,
        asked.readings,
        asked.count,
        np.random.default_rng(asked.seed),
        criterion=asked.criterion,
        priors=asked.priors,
        candidates=asked.candidates,
        counts=[count for count in TABLE if count <= asked.candidates],
        margin=asked.margin,
        draw=drawn_for(asked.site, asked.margin),
    )


def answer_for(asked: Search) -> Sought:
    """Search once among several."""
    assert asked.fresh is not None
    try:
        found = search(asked)
    except BadInput as why:
        return Sought(None, why=why)
    return Sought(found, misses(found, asked.readings, asked.fresh))


def best_of(
    searches: list[Search],
    workers: int | None,
    scheduler: str,
    watch: Callable[[int, int], None] | None,
) -> tuple[Design, int]:
    """The design that leaves the platform least far off, and its seed.

    Raises
    ------
    BadInput
        If no search comes to an end, as the first of them says; if the scheduler does not answer.
    """
    found: dict[int, Sought] = {}
    for number, one in spread(answer_for, searches, workers=workers, scheduler=scheduler):
        found[number] = one
        if watch is not None:
            watch(len(found), len(searches))
    best = min(range(len(searches)), key=lambda number: (found[number].miss, number))
    design = found[best].design
    if design is None:
        why = found[0].why
        assert why is not None
        raise why
    return design, searches[best].seed


def fresh_poses(machine: Machine, seed: int) -> PoseSet:
    """Reachable poses at which all searches are judged."""
    return sample_poses(machine, FRESH, np.random.default_rng((seed, FRESH)))
