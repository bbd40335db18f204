"""The machine as it was sent: which pose, nests, and the beam, drawn anew when they change."""

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from textual.content import Content
from textual.widgets import Static

from app.tui.picture import Picture
from calib.arrays import Array

if TYPE_CHECKING:
    from app.files.site import Site

ROOM = 0.12
"""Part of the machine's size that is left free around it: it moves."""


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
        drawn = (id(site), pose, nest, frame, size)
        if drawn == self._drawn or size.width < 30 or size.height < 6:
            return
        self._drawn = drawn
        if site is None:
            self.update("")
            return
        there = site.tracker_there
        frame = frame or (there.frame if there is not None else None)
        heads, drawing = sketch(site, pose, nest, frame, *size)
        self.update(Content(f"{heads}\n{drawing}"))
        at = picture.pose.pose_label if picture.pose is not None else "home"
        self.border_subtitle = f"{at}; nests, beam to {nest}" if nest else at


def sketch(
    site: "Site",
    pose: tuple[float, ...] | None,
    nest: str,
    frame: tuple[float, ...] | None,
    columns: int,
    rows: int,
) -> tuple[str, str]:
    """Headings and drawing; ``frame`` is the base frame in that of a tracker, if any."""
    from app.show.machine_sketch import Around, corners_of, two_views
    from calib.analysis.skeleton import skeleton
    from calib.mechanism.rigid import Poses
    from calib.mechanism.solve import home_configuration, inverse

    machine = site.machine
    home = home_configuration(machine)
    here = home if pose is None else inverse(machine, Poses.from_xyz_rpy(np.array(pose)[:, None]))
    shape, still = skeleton(machine, here), corners_of(skeleton(machine, home))
    platform = _centres(site.platform_nests)
    moved = shape.rotation @ platform + shape.position[:, None]
    nests = np.concatenate([moved, _centres(site.base_nests)], axis=1)
    least, largest = still.min(axis=1), still.max(axis=1)
    room = ROOM * float(np.max(largest - least))
    beam = None
    names = [*site.platform_nests, *site.base_nests]
    if nest in names and frame is not None:
        tracker = Poses.from_xyz_rpy(np.array(frame)[:, None])
        stands = -tracker.rotation[:, :, 0].T @ tracker.position[:, 0]
        beam = np.stack([nests[:, names.index(nest)], stands], axis=1)
    corners = np.stack([least - room, largest + room], axis=1)
    return two_views(shape, columns, rows - 1, Around(nests, beam, corners))


def _centres(nests: Mapping[str, Sequence[float]]) -> Array:
    values = list(nests.values())
    return np.array(values, float).reshape(-1, 3).T
