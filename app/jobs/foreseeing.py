"""Poses that are to show what a machine may hide, and what a plan will and will not see."""

from dataclasses import replace
from typing import Any

import numpy as np

from app.files.poses import nest_matrix
from app.files.site import Site
from app.jobs.read_there import SITE_SIGMA_UM, readings_of
from calib.discover.exploring import explore
from calib.discover.planned import Sight, foreseen, planned_fit
from calib.effects import catalogue
from calib.effects.component import Effect
from calib.errors import BadInput
from calib.identify import Fit
from calib.mechanism.description import Machine
from calib.mechanism.limits import Margin
from calib.model.prototype import nests_of
from calib.poses.design import Design, lengthened
from calib.poses.reach import PoseSet, joined_poses, sample_poses
from calib.poses.readings import NestReadings, Readings
from calib.runs import Header
from calib.runs.stack import Rows
from calib.unknown import searched_in_words

RESERVED = 3
"""Of so many poses one is there to show what the machine may hide."""
OFFERED = 250
"""Reachable poses among which it is chosen."""
HARD = 0.5
"""Probability to see an effect below which it is said where, and why if the poses say so."""


def read_by_tracker(
    machine: Machine,
    site: Site | None,
    heights: bool,
    sigma_um: float | None,
    angle_mdeg: float | None,
) -> NestReadings:
    """Nests of the site, or some as large as the machine.

    Raises
    ------
    BadInput
        Where something else is to be read.
    """
    if heights or angle_mdeg is not None or (site is not None and site.gauge is not None):
        raise BadInput(
            "what a plan will see of effects is known for points that a tracker reads",
            remedy="Leave --heights and --angle-mdeg out, and name a site with a "
            "[tracker], or none",
        )
    if site is not None:
        found = readings_of(machine, site, False, sigma_um, None)
        assert isinstance(found, NestReadings)
        return found
    sigma = (SITE_SIGMA_UM if sigma_um is None else sigma_um) * 1e-3
    if sigma <= 0.0:
        raise BadInput(f"--sigma-um is {sigma_um:g}", remedy="Give a positive uncertainty.")
    platform, base = nests_of(machine)
    return NestReadings(nest_matrix(platform), sigma, nest_matrix(base))


def explored(
    plain: Design,
    own: Design,
    readings: Readings,
    site: Site | None,
    rng: np.random.Generator,
    margin: Margin | None,
) -> tuple[Design, dict[str, Any]]:
    """Add poses that show what the machine may hide to those of ``own``, as many as ``plain`` has.

    Returns
    -------
    Design, and what it will see beside ``plain``: ``purpose``, ``will_see``, ``not_asked``.
    """
    assert isinstance(readings, NestReadings)
    machine = plain.machine
    header, sigma = _header(machine, site), readings.sigma
    payload = (site.payload_kg or 0.0) if site is not None else 0.0
    effects = catalogue(machine)

    def fitted(poses: PoseSet) -> Fit:
        return planned_fit(machine.name, poses, header, sigma, payload)

    offered = joined_poses(machine, [sample_poses(machine, OFFERED, rng, margin), own.pose_set])
    count = plain.pose_set.count - own.pose_set.count
    chosen = explore(fitted(own.pose_set), effects, offered, count, rng)
    design = lengthened(own, offered.take(np.array(chosen)), readings, rng, margin)
    design = replace(design, random=plain.random, by_count=plain.by_count)
    there = fitted(design.pose_set)
    now = foreseen(there, effects, np.random.default_rng(2))
    before = foreseen(fitted(plain.pose_set), effects, np.random.default_rng(2))
    plainly = {one.effect: one.power for one in before}
    rows, named = there.model.rows, {effect.id: effect for effect in effects}
    seen = [
        {
            "effect": one.effect,
            "power": one.power,
            "by_accuracy": plainly[one.effect],
            "why": _why(one, named[one.effect], rows),
        }
        for one in now
    ]
    reasons = {effect.id: effect.unavailable(rows) for effect in effects}
    beside = {
        effect.id: f"asked once {' or '.join(effect.beside)} is in the model"
        for effect in effects
        if effect.beside
    }
    told = {name: why for name, why in {**beside, **reasons}.items() if why}
    return design, {"purpose": "discovery", "will_see": seen, "not_asked": told}


def _why(one: Sight, effect: Effect, rows: Rows) -> str:
    """Where an effect is hardly seen, and what the poses lack for it."""
    if one.least >= HARD:
        return ""
    at = searched_in_words(effect.unknowns(rows), one.at)
    where = [f"{one.least:.2f} where {at}"] if at else []
    lacking = effect.hard_to_see(rows.machine, rows.extension)
    return "; ".join([*where, *([lacking] if lacking else [])])


def _header(machine: Machine, site: Site | None) -> Header | None:
    if site is None:
        return None
    return Header(
        machine.name,
        platform_nests={name: np.array(at) for name, at in site.platform_nests.items()},
        base_nests={name: np.array(at) for name, at in site.base_nests.items()},
        load=site.load,
    )
