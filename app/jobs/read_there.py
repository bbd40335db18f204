"""What is read at the poses that are chosen: whole poses, nests, heights, or a site's gauge."""

from collections.abc import Callable

import numpy as np

from app.files.poses import nest_matrix
from app.files.site import Site
from app.files.site_gauge import GaugeSite
from app.session.spans import shows
from calib.arrays import BoolArray
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.mechanism.limits import Margin
from calib.mechanism.rigid import Poses
from calib.poses.gauges import (
    Bring,
    DistanceReadings,
    TiltReadings,
    gauge_poses,
    to_plane,
    to_span,
)
from calib.poses.reach import PoseSet
from calib.poses.readings import HAN_2020, DirectionReadings, NestReadings, PoseNoise, Readings

ANGLES = ("rx", "ry", "rz", "tilt", "azimuth")
SITE_SIGMA_UM = 5.0
"""Standard uncertainty per axis that is expected of a reading of a nest."""
PROBE_SIGMA_UM = 10.0
"""The same of a height, by a touch probe."""
CALIPERS_SIGMA_UM = 20.0
"""The same of a distance between two marks."""


def readings_of(
    machine: Machine,
    site: Site | None,
    heights: bool,
    sigma_um: float | None,
    angle_mdeg: float | None,
) -> Readings:
    """Nests of the site, or whole poses with the noise of Han et al. 2020 if nothing is said."""
    for value, what in ((sigma_um, "--sigma-um"), (angle_mdeg, "--angle-mdeg")):
        if value is not None and value <= 0.0:
            raise BadInput(f"{what} is {value:g}", remedy="Give a positive uncertainty.")
    if site and site.gauge is not None:
        if heights or angle_mdeg is not None:
            raise BadInput(
                "the site says what is read", remedy="Leave --heights and --angle-mdeg out"
            )
        return _of_gauge(site, site.gauge, sigma_um)
    if heights:
        if angle_mdeg is not None:
            raise BadInput("heights have no angle", remedy="Leave --angle-mdeg out.")
        nests = nest_matrix(site.platform_nests) if site else np.zeros((3, 1))
        sigma = (PROBE_SIGMA_UM if sigma_um is None else sigma_um) * 1e-3
        return DirectionReadings(nests, np.array([[0.0], [0.0], [1.0]]), sigma)
    if site:
        sigma = (SITE_SIGMA_UM if sigma_um is None else sigma_um) * 1e-3
        return NestReadings(nest_matrix(site.platform_nests), sigma, nest_matrix(site.base_nests))
    sigma = HAN_2020.position_sigma if sigma_um is None else sigma_um * 1e-3
    if angle_mdeg is not None:
        return PoseNoise(sigma, float(np.deg2rad(angle_mdeg * 1e-3)))
    turns = any(name in ANGLES for name in machine.task.coordinates)
    return PoseNoise(sigma, HAN_2020.angle_sigma if turns else None)


def _of_gauge(site: Site, gauge: GaugeSite, sigma_um: float | None) -> Readings:
    """What a site's gauge reads."""
    sigma = gauge.sigma if sigma_um is None else sigma_um * 1e-3
    if gauge.reads == "distance":
        return DistanceReadings(_ends(site, gauge), sigma, _span(gauge))
    if gauge.reads == "tilt":
        gravity = np.array(site.load.gravity if site.load else (0.0, 0.0, -1.0))
        axis = gauge.instrument.axis
        assert axis is not None
        return TiltReadings(axis, -gravity / np.linalg.norm(gravity), sigma)
    nest = np.array(site.platform_nests[gauge.nest])[:, None]
    return DirectionReadings(nest, np.array(gauge.away)[:, None], sigma)


def drawn_for(
    site: Site | None, margin: Margin
) -> Callable[[int, np.random.Generator], PoseSet] | None:
    """How candidates are drawn at which the site's gauge is in range; None: anywhere in reach."""
    if site is None or site.gauge is None:
        return None
    gauge, bring = site.gauge, _bring(site, site.gauge)
    heights = (gauge.clearance_mm, -gauge.search.below_mm if gauge.search else 0.0)
    lifts = [height * np.array(gauge.away) for height in heights if height]
    if bring is None and not lifts:
        return None

    def in_range(poses: Poses) -> BoolArray:
        return np.array([shows(site, gauge, pose) for pose in poses.to_xyz_rpy().T.tolist()])

    return gauge_poses(site.machine, bring, lifts, margin=margin, shows=in_range)


def _bring(site: Site, gauge: GaugeSite) -> Bring | None:
    """How a pose is brought to where the gauge shows something."""
    bounded = bool(np.isfinite(gauge.lowest) and np.isfinite(gauge.highest))
    if gauge.reads == "distance":
        return to_span(_ends(site, gauge), _span(gauge)) if bounded else None
    if gauge.reads == "tilt" or not (gauge.plane or bounded):
        return None
    middle = gauge.sign * 0.5 * (gauge.lowest + gauge.highest) if bounded else 0.0
    offset = gauge.zero_at + middle
    if gauge.plane and site.setup:
        plane = site.setup.planes[gauge.plane]
        offset += float(plane.normal @ plane.through)
    return to_plane(np.array(site.platform_nests[gauge.nest]), np.array(gauge.away), offset)


def _ends(site: Site, gauge: GaugeSite) -> tuple[np.ndarray, np.ndarray]:
    """Nests of the pairs, (3, K) each."""
    one = np.array([site.platform_nests[pair[0]] for pair in gauge.pairs]).T
    two = np.array([site.base_nests[pair[1]] for pair in gauge.pairs]).T
    return one, two


def _span(gauge: GaugeSite) -> tuple[float, float]:
    """Shortest and longest distance that it can show, mm."""
    ends = sorted(gauge.zero_at + gauge.sign * one for one in (gauge.lowest, gauge.highest))
    return max(ends[0], 0.0), ends[1]
