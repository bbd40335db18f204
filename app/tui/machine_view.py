"""The machine as it was sent: its pose, nests, the beam, and how far each nest is off."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING

import numpy as np
from textual.content import Content
from textual.widgets import Static

from app.tui.parts import Point
from app.tui.picture import Picture
from calib.arrays import Array

if TYPE_CHECKING:
    from app.files.site import Site

ROOM = 0.12
"""Part of the machine's size that is left free around it: it moves."""
LONGEST = 0.25
"""The longest arrow as a part of the machine's size."""


class MachineView(Static):
    """Front and above; where it is too small nothing is drawn."""

    def __init__(self, *, id: str) -> None:  # noqa: A002 - Textual's own name
        super().__init__(id=id, classes="panel")
        self.border_title = "Machine"
        self._drawn: object = None
        self._shown: tuple[Site | None, Picture] | None = None

    def on_resize(self) -> None:
        """Draw for the new size."""
        if self._shown is not None:
            self.show(*self._shown)

    def show(self, site: "Site | None", picture: Picture) -> None:
        """Draw the machine at the pose that was commanded last, at home before the first."""
        self._shown = site, picture
        size = self.content_size
        pose = picture.pose.pose if picture.pose is not None else None
        nest = picture.last_reading.nest if picture.last_reading is not None else ""
        frame = picture.frame.frame if picture.frame is not None else None
        drawn = (id(site), pose, nest, frame, len(picture.points), size)
        if drawn == self._drawn or size.width < 30 or size.height < 6:
            return
        self._drawn = drawn
        if site is None:
            self.update("")
            return
        there = site.tracker_there
        frame = frame or (there.frame if there is not None else None)
        seen = Seen(pose, nest, frame, last_off(picture.points))
        heads, drawing, arrows, times = sketch(site, seen, *size)
        self.update(Content("\n").join([Content(heads), over(drawing, arrows)]))
        at = picture.pose.pose_label if picture.pose is not None else "home"
        words = [f"{at}; nests, beam to {nest}" if nest else at]
        if times:
            words.append(f"last errors x{times:g}")
        self.border_subtitle = "; ".join(words)


@dataclass(frozen=True, eq=False)
class Seen:
    """What is drawn of a moment: ``frame`` is the base frame in that of a tracker, if any.

    ``off`` has the last error of each nest, base axes, mm.
    """

    pose: tuple[float, ...] | None
    nest: str
    frame: tuple[float, ...] | None
    off: Mapping[str, tuple[float, float, float]]


def last_off(points: Sequence[Point]) -> dict[str, tuple[float, float, float]]:
    """The last error of each nest that was read."""
    return {point.nest: point.off for point in points if any(point.off)}


def sketch(site: "Site", seen: Seen, columns: int, rows: int) -> tuple[str, str, str, float]:
    """Headings, drawing, arrows of errors sign over sign with it, and how enlarged these are."""
    from app.show.machine_sketch import Around, corners_of, two_arrows, two_views
    from calib.analysis.skeleton import skeleton
    from calib.mechanism.rigid import Poses
    from calib.mechanism.solve import home_configuration, inverse

    machine = site.machine
    home = home_configuration(machine)
    here = home
    if seen.pose is not None:
        here = inverse(machine, Poses.from_xyz_rpy(np.array(seen.pose)[:, None]))
    shape, still = skeleton(machine, here), corners_of(skeleton(machine, home))
    platform = _centres(site.platform_nests)
    moved = shape.rotation @ platform + shape.position[:, None]
    nests = np.concatenate([moved, _centres(site.base_nests)], axis=1)
    least, largest = still.min(axis=1), still.max(axis=1)
    size = float(np.max(largest - least))
    beam = None
    names = [*site.platform_nests, *site.base_nests]
    if seen.nest in names and seen.frame is not None:
        tracker = Poses.from_xyz_rpy(np.array(seen.frame)[:, None])
        stands = -tracker.rotation[:, :, 0].T @ tracker.position[:, 0]
        beam = np.stack([nests[:, names.index(seen.nest)], stands], axis=1)
    corners = np.stack([least - ROOM * size, largest + ROOM * size], axis=1)
    read = [names.index(nest) for nest in seen.off if nest in names]
    off = np.array([seen.off[names[k]] for k in read]).reshape(-1, 3).T
    times = enlarged(off, LONGEST * size)
    arrows = np.stack([nests[:, read], nests[:, read] + times * off], axis=1)
    around = Around(nests, beam, corners, arrows)
    heads, drawing = two_views(shape, columns, rows - 1, around)
    return heads, drawing, two_arrows(shape, columns, rows - 1, around), times


def enlarged(off: Array, longest: float) -> float:
    """A round number (1, 2, 5 times a power of ten) that makes errors (3, K) seen; 0 for none."""
    largest = float(np.max(np.linalg.norm(off, axis=0), initial=0.0))
    if largest <= 0.0:
        return 0.0
    wanted = longest / largest
    decade = 10.0 ** math.floor(math.log10(wanted))
    return decade * max(step for step in (1.0, 2.0, 5.0) if step * decade <= wanted)


def over(drawing: str, arrows: str) -> Content:
    """The drawing with the arrows in it, in another colour."""
    lines = []
    for below, above in zip(drawing.splitlines(), arrows.splitlines(), strict=True):
        both = [(_both(a, b), ord(b) > BLANK) for a, b in zip(below, above, strict=True)]
        runs = [
            ("".join(sign for sign, _ in run), "bold $ink-accent" if is_arrow else "")
            for is_arrow, run in groupby(both, key=lambda one: one[1])
        ]
        lines.append(Content.assemble(*runs))
    return Content("\n").join(lines)


BLANK = 0x2800
"""The sign of dots without a dot; the eight bits above it are its dots."""


def _both(below: str, above: str) -> str:
    return chr(ord(below) | ord(above)) if ord(above) > BLANK else below


def _centres(nests: Mapping[str, Sequence[float]]) -> Array:
    values = list(nests.values())
    return np.array(values, float).reshape(-1, 3).T
