"""Where a machine is verified."""

import os
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np

from app.files.machines import load_machine
from app.files.pose_table import Pose
from app.files.poses import render_pose_file
from app.files.site import Site, load_site
from app.jobs.chosen_runs import File
from app.jobs.record import Report
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.poses.verification import VerificationGrid, verification_poses


@dataclass(frozen=True, kw_only=True)
class GridReport(Report):
    """The verification grid of a machine (``pkm-verification/1``).

    ``box`` is what of the workspace it spans (mm, deg); ``poses``: label -> x, y, z (mm),
    rx, ry, rz (rad), platform in the base frame.
    """

    FORMAT: ClassVar[str] = "pkm-verification/1"
    machine: str
    workspace_scale: float
    box: Mapping[str, tuple[float, ...]]
    poses: Mapping[str, tuple[float, ...]]
    _grid: VerificationGrid = field(repr=False, compare=False)

    def by_label(self) -> dict[str, Pose]:
        """Label -> x, y, z (mm), rx, ry, rz (rad): the platform in the base frame, in order."""
        return self._grid.by_label

    def save(self, file: File) -> None:
        """Write a poses file."""
        command = f"pkmcal poses {self.machine} --verification"
        title = f"{len(self._grid.labels)} verification poses for {self.machine}"
        about = {"workspace_scale": self._grid.scale}
        text = render_pose_file(self._grid.labels, self._grid.pose_set, title, about, command)
        Path(file).write_text(text, encoding="utf-8")


def verification_grid(
    machine: str | os.PathLike[str] | None = None, *, site: File | None = None
) -> GridReport:
    """The poses at which a machine is verified: 27 nodes with 8 orientations, all within reach.

    Parameters
    ----------
    machine : str or path, optional
        A shipped machine's name, or a machine file; that of the site if missing.
    site : path, optional
        A site file.

    Returns
    -------
    GridReport

    Raises
    ------
    BadInput
        For a machine or site that cannot be read.

    Examples
    --------
    >>> len(pkmcal.verification_grid("hexapod").poses)                       # doctest: +SKIP
    216
    """
    described = machine_for("" if machine is None else os.fspath(machine), site_of(site))
    grid = verification_poses(described)
    box = {
        name: [low, high] if name in "xyz" else [float(np.rad2deg(low)), float(np.rad2deg(high))]
        for name, (low, high) in grid.box.items()
    }
    said = {
        "format": "pkm-verification/1",
        "machine": described.name,
        "workspace_scale": grid.scale,
        "box": box,
        "poses": grid.by_label,
    }
    return GridReport.of(said, _grid=grid)


def site_of(site: File | Site | None) -> Site | None:
    """What is read of a site file, if one is named."""
    if site is None or isinstance(site, Site):
        return site
    return load_site(Path(site))


def machine_for(name: str, site: Site | None) -> Machine:
    """The machine that is named, or that of the site; raises BadInput."""
    if name:
        return load_machine(name)
    if site:
        return site.machine
    raise BadInput("no machine is named", remedy="Write pkmcal poses hexapod, or give --site.")
