"""What a gauge should read, by the nominal machine; lengths mm, angles rad, base frame."""

from collections.abc import Mapping

import numpy as np

from app.files.pose_table import Pose
from app.files.site import Site
from app.files.site_gauge import GaugeSite
from calib.arrays import Array
from calib.frames import nest_in_base
from calib.mechanism.rigid import Poses
from calib.mechanism.solve import forward, inverse

WAY = 24
"""Places at which the way between two poses is looked at."""
UP = (0.0, 0.0, 1.0)


def between(site: Site, poses: tuple[Pose, Pose], nests: tuple[str, str]) -> float:
    """Distance from the first nest at the first pose to the second one at the second pose."""
    ends = [
        nest_in_base(pose, site.platform_nests[nest])
        if nest in site.platform_nests
        else np.array(site.base_nests[nest])
        for pose, nest in zip(poses, nests, strict=True)
    ]
    return float(np.linalg.norm(ends[0] - ends[1]))


def along(site: Site, gauge: GaugeSite, pose: Pose) -> float:
    """Of a direction or a tilt: what is measured at a pose."""
    if gauge.reads == "tilt":
        axis = gauge.instrument.axis
        assert axis is not None
        turned = nest_in_base((0.0, 0.0, 0.0, *pose[3:]), tuple(axis))
        down = np.array(site.load.gravity if site.load else np.negative(UP))
        return float(np.arcsin(np.clip(-turned @ down / np.linalg.norm(down), -1.0, 1.0)))
    offset = 0.0
    if gauge.plane and site.setup:
        plane = site.setup.planes[gauge.plane]
        offset = float(plane.normal @ plane.through)
    return (
        float(np.array(gauge.away) @ nest_in_base(pose, site.platform_nests[gauge.nest])) - offset
    )


def shown(gauge: GaugeSite, measured: float) -> float:
    """What the gauge shows of something."""
    return gauge.sign * (measured - gauge.zero_at)


def within(site: Site, gauge: GaugeSite, pose: Pose, pair: tuple[str, str]) -> bool:
    """Whether a pair is in range at a pose."""
    return gauge.lowest <= shown(gauge, between(site, (pose, pose), pair)) <= gauge.highest


def shows(site: Site, gauge: GaugeSite, pose: Pose) -> bool:
    """Whether it shows a number at a pose: of a distance, for any of its pairs."""
    if gauge.reads == "distance":
        return any(within(site, gauge, pose, pair) for pair in gauge.pairs)
    return gauge.lowest <= shown(gauge, along(site, gauge, pose)) <= gauge.highest


def stays_in_range(
    site: Site, gauge: GaugeSite, poses: Mapping[str, Pose], pair: tuple[str, str], one: str,
    two: str,
) -> bool:  # fmt: skip
    """Whether a pair stays in range on the way, which is straight for the actuators."""
    machine = site.machine
    ends = inverse(machine, Poses.from_xyz_rpy(np.array([poses[one], poses[two]]).T)).extension
    share = np.linspace(0.0, 1.0, WAY)
    way = forward(machine, ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * share).poses
    arm: Array = np.einsum("ijn,j->in", way.rotation, np.array(site.platform_nests[pair[0]]))
    apart = way.position + arm - np.array(site.base_nests[pair[1]])[:, None]
    seen = gauge.sign * (np.linalg.norm(apart, axis=0) - gauge.zero_at)
    return bool(np.all((seen >= gauge.lowest) & (seen <= gauge.highest)))
