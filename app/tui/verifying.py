"""Verification sessions: the plan, and what became of them, judged again from their journals."""

import asyncio
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from app.files.site import Site
from app.session.plan import Plan
from app.verification import Verification, judge_session
from app.verification import verification_plan as plan_for
from calib.arrays import Array
from calib.poses import verification_poses

QUICK_EVERY = 8
"""One orientation of eight at each node of the grid; another one at each."""


@dataclass(frozen=True, eq=False)
class Verified:
    """A finished verification; ``errors`` (2, N): position in um, orientation in mdeg."""

    folder: Path
    found: Verification
    errors: Array


def one_in_eight(labels: list[str]) -> list[str]:
    """One orientation at each node of a grid of eight orientations, another one at each."""
    if len(labels) < 8 * QUICK_EVERY:
        return labels
    nodes = range(len(labels) // QUICK_EVERY)
    return [labels[node * QUICK_EVERY + node % QUICK_EVERY] for node in nodes]


async def verification_plan(site: Site, quick: bool) -> Plan:
    """The grid of 27 nodes x 8 orientations, or one orientation at each node."""
    # A moment of arithmetic: beside the event loop, so that the stop key stays alive.
    poses = (await asyncio.to_thread(verification_poses, site.machine)).by_label
    if quick:
        poses = {label: poses[label] for label in one_in_eight(list(poses))}
    return plan_for(site, poses, truth=site.hands.kind == "mock")


def verified(folder: Path) -> Verified:
    """Judge a finished session from its folder; raises :class:`calib.errors.BadInput`."""
    found = judge_session(folder)
    position = 1e3 * np.linalg.norm(found.position_mm, axis=0)
    angle = 1e3 * np.rad2deg(np.linalg.norm(found.rotation_rad, axis=0))
    return Verified(folder, found, np.array([position, angle]))
