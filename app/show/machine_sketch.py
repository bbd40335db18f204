"""A machine in a terminal: from the front and from above, with what stands and moves around it."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from app.show.braille import Canvas, beside
from calib.analysis.skeleton import Skeleton
from calib.arrays import Array

FRONT, ABOVE = (0, 2), (0, 1)
"""Axes across and up: x to the right and z up; x to the right and y up."""


@dataclass(frozen=True, eq=False)
class Around:
    """What is drawn beside the machine, in the base frame, mm.

    Attributes
    ----------
    nests : (3, M)
        Centres of nests, each a small square.
    beam : (3, 2), optional
        From an SMR to the tracker; what is outside of the drawing is not seen.
    arrows : (3, 2, K)
        Begin and end of what is drawn by :func:`two_arrows`.
    room : (3, 2), optional
        Least and largest corner of what is shown; the machine's own if None. With one room a
        machine that moves stays where it is in the drawing.
    """

    nests: Array = field(default_factory=lambda: np.zeros((3, 0)))
    beam: Array | None = None
    room: Array | None = None
    arrows: Array = field(default_factory=lambda: np.zeros((3, 2, 0)))


def corners_of(skeleton: Skeleton) -> Array:
    """Every corner of the machine, (3, K)."""
    limbs = [limb.corners for limb in skeleton.limbs]
    return np.concatenate([*limbs, skeleton.position[:, None]], axis=1)


def draw_view(
    skeleton: Skeleton, axes: tuple[int, int], columns: int, rows: int, around: Around
) -> list[str]:
    """One view as lines of characters."""
    plane = list(axes)
    canvas = _canvas(skeleton, axes, columns, rows, around)
    for limb in skeleton.limbs:
        _chain(canvas, limb.corners[plane, limb.first : limb.last + 1])
        for joint in limb.joints:
            if joint.driven:
                canvas.mark(joint.place[plane])
    for points in (skeleton.base_points, skeleton.platform_points):
        _chain(canvas, ring(points)[plane])
    for nest in around.nests[plane].T:
        canvas.mark(nest)
    if around.beam is not None:
        _chain(canvas, around.beam[plane])
    return canvas.lines()


def draw_arrows(
    skeleton: Skeleton, axes: tuple[int, int], columns: int, rows: int, around: Around
) -> list[str]:
    """The arrows alone, in the place of :func:`draw_view`; each has a square where it begins."""
    canvas = _canvas(skeleton, axes, columns, rows, around)
    for begin, end in around.arrows[list(axes)].transpose(2, 1, 0):
        canvas.line(begin, end)
        canvas.mark(begin)
    return canvas.lines()


def _canvas(
    skeleton: Skeleton, axes: tuple[int, int], columns: int, rows: int, around: Around
) -> Canvas:
    shown = corners_of(skeleton) if around.room is None else around.room
    flat = shown[list(axes)]
    return Canvas(columns, rows, flat.min(axis=1), flat.max(axis=1))


def _chain(canvas: Canvas, points: Array) -> None:
    for k in range(1, points.shape[1]):
        canvas.line(points[:, k - 1], points[:, k])


def two_views(skeleton: Skeleton, columns: int, rows: int, around: Around) -> tuple[str, str]:
    """Front and above side by side: a line of headings, and the drawing."""
    width = (columns - 2) // 2
    views = [draw_view(skeleton, axes, width, rows, around) for axes in (FRONT, ABOVE)]
    return f"{'front (x, z)':{width}}  from above (x, y)", beside(views[0], views[1])


def two_arrows(skeleton: Skeleton, columns: int, rows: int, around: Around) -> str:
    """The arrows of both views, sign over sign with the drawing of :func:`two_views`."""
    width = (columns - 2) // 2
    views = [draw_arrows(skeleton, axes, width, rows, around) for axes in (FRONT, ABOVE)]
    return beside(views[0], views[1])


def draw_text(skeleton: Skeleton, columns: int, rows: int) -> str:
    """The machine alone from the front and from above, under a line of headings."""
    return "\n".join(two_views(skeleton, columns, rows, Around()))


def ring(points: Array) -> Array:
    """Outline (3, k) of joints that lie more or less in a plane; empty for fewer than three."""
    if points.shape[1] < 3:
        return points[:, :0]
    away = points - points.mean(axis=1, keepdims=True)
    plane, spread, _ = np.linalg.svd(away, full_matrices=False)
    if spread[1] < 1e-6 * max(spread[0], 1e-9):
        return points[:, :0]
    corners = _hull((plane[:, :2].T @ away).T)
    outline: Array = points[:, [*corners, corners[0]]]
    return outline


def _hull(points: Array) -> list[int]:
    """Corners of the convex hull of points (n, 2), round it once (Andrew's monotone chain)."""

    def half(order: Sequence[int]) -> list[int]:
        kept: list[int] = []
        for k in order:
            while len(kept) > 1 and _turn(points[kept[-2]], points[kept[-1]], points[k]) <= 0.0:
                kept.pop()
            kept.append(k)
        return kept[:-1]

    order = [int(k) for k in np.lexsort((points[:, 1], points[:, 0]))]
    return half(order) + half(order[::-1])


def _turn(a: Array, b: Array, c: Array) -> float:
    """Positive where the way from a over b to c turns left."""
    return float((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]))
