"""A machine drawn in three dimensions into a file."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from app.show.charts import save
from app.show.machine_sketch import ring
from calib.analysis.skeleton import LimbLine, Skeleton
from calib.arrays import Array

FRAME, LIMB, PASSIVE, DRIVEN = "#777777", "#1f6f8b", "#333333", "#c8553d"
TRIAD = ("#c0392b", "#27ae60", "#2c5fa8")


def draw_figure(skeleton: Skeleton, title: str, path: Path) -> None:
    """Draw limbs, joints with their axes, base, platform and both frames; mm."""
    figure = Figure(figsize=(8.5, 8.0), layout="constrained")
    axes = figure.add_subplot(projection="3d")
    size = _size(skeleton)
    for limb in skeleton.limbs:
        _limb(axes, limb, 0.045 * size)
    for points in (skeleton.base_points, skeleton.platform_points):
        axes.plot(*ring(points), color=FRAME, lw=2.5, alpha=0.6)
    _triad(axes, np.zeros(3), np.eye(3), 0.18 * size)
    _triad(axes, skeleton.position, skeleton.rotation, 0.18 * size)
    for says, style in (
        ("passive joint, with its axis", {"color": PASSIVE, "marker": "o"}),
        ("driven joint", {"color": DRIVEN, "marker": "s"}),
    ):
        axes.plot([], [], [], ls="", label=says, **style)
    axes.set_xlabel("x, mm")
    axes.set_ylabel("y, mm")
    axes.set_zlabel("z, mm")
    axes.set_aspect("equal")
    axes.set_title(title)
    axes.legend(loc="upper left", fontsize=8)
    save(figure, path)


def _limb(axes: object, limb: LimbLine, tick: float) -> None:
    plot = axes.plot  # type: ignore[attr-defined]
    first, last = limb.corners[:, limb.first], limb.corners[:, limb.last]
    plot(*np.stack([limb.corners[:, 0], first], axis=1), color=FRAME, lw=0.8, ls=":")
    plot(*limb.corners[:, limb.first : limb.last + 1], color=LIMB, lw=2.2)
    plot(*np.stack([last, limb.corners[:, -1]], axis=1), color=FRAME, lw=0.8, ls=":")
    for joint in limb.joints:
        colour = DRIVEN if joint.driven else PASSIVE
        along = np.stack([joint.place - tick * joint.axis, joint.place + tick * joint.axis], axis=1)
        plot(*along, color=colour, lw=1.4)
        plot(*joint.place[:, None], color=colour, marker="s" if joint.driven else "o", ms=4)


def _triad(axes: object, origin: Array, rotation: Array, length: float) -> None:
    for column, colour in zip(rotation.T, TRIAD, strict=True):
        ends = np.stack([origin, origin + length * column], axis=1)
        axes.plot(*ends, color=colour, lw=2.0)  # type: ignore[attr-defined]


def _size(skeleton: Skeleton) -> float:
    corners = np.concatenate([limb.corners for limb in skeleton.limbs], axis=1)
    return float(np.max(corners.max(axis=1) - corners.min(axis=1)))
