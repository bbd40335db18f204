"""A machine drawn: in three dimensions into a file, or from two sides in the terminal."""

from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from scipy.spatial import ConvexHull

from app.show.braille import Canvas, beside
from app.show.charts import save
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
        axes.plot(*_ring(points), color=FRAME, lw=2.5, alpha=0.6)
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


def _ring(points: Array) -> Array:
    """Outline (3, k) of joints that lie more or less in a plane; empty for fewer than three."""
    if points.shape[1] < 3:
        return points[:, :0]
    away = points - points.mean(axis=1, keepdims=True)
    plane, spread, _ = np.linalg.svd(away, full_matrices=False)
    if spread[1] < 1e-6 * max(spread[0], 1e-9):
        return points[:, :0]
    corners = ConvexHull((plane[:, :2].T @ away).T).vertices
    outline: Array = points[:, np.append(corners, corners[0])]
    return outline


def draw_text(skeleton: Skeleton, columns: int, rows: int) -> str:
    """The same from the front (x to the right, z up) and from above (y up), in characters."""
    views = []
    for across, up in ((0, 2), (0, 1)):
        corners = np.concatenate(
            [*(limb.corners for limb in skeleton.limbs), skeleton.position[:, None]], axis=1
        )
        flat = corners[[across, up]]
        canvas = Canvas((columns - 2) // 2, rows, flat.min(axis=1), flat.max(axis=1))
        for limb in skeleton.limbs:
            line = limb.corners[[across, up], limb.first : limb.last + 1]
            for k in range(line.shape[1] - 1):
                canvas.line(line[:, k], line[:, k + 1])
            for joint in limb.joints:
                if joint.driven:
                    canvas.mark(joint.place[[across, up]])
        for points in (skeleton.base_points, skeleton.platform_points):
            ring = _ring(points)[[across, up]]
            for k in range(1, ring.shape[1]):
                canvas.line(ring[:, k - 1], ring[:, k])
        views.append(canvas.lines())
    width = (columns - 2) // 2
    head = f"{'front (x, z)':{width}}  from above (x, y)"
    return f"{head}\n{beside(views[0], views[1])}"
