"""What is left of each reading after a fit: along the base's axes, in sigmas, and where it was."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from calib.arrays import Array
from calib.identify import Fit


@dataclass(frozen=True)
class ReadingLine:
    """One reading.

    ``name`` is what ``--mask`` takes: its line, with several runs behind the run's folder.
    ``off_um`` (dx, dy, dz) is measured minus predicted along the axes of the base and
    ``place_mm`` where the SMR was in the base frame; both nan for readings that are no points.
    ``left_out`` says why it is not in the fit.
    """

    number: int
    name: str
    line: int
    pose: str
    nest: str
    on_platform: bool
    off_um: tuple[float, float, float]
    distance_um: float
    sigmas: float
    place_mm: tuple[float, float, float]
    left_out: str = ""


def lines_of_fit(fit: Fit) -> list[ReadingLine]:
    """Every reading of a fit, in the order of the rows."""
    rows, linear = fit.model.rows, fit.linear
    off = 1000.0 * np.einsum("kin,kn->in", linear.situation.frame_rotation, linear.residual)
    place = linear.situation.base_point
    why = {int(row): "lacks a channel" for row in np.flatnonzero(fit.model.lacking)}
    why |= {one.row: one.why for one in fit.bad}
    return [
        ReadingLine(
            number=number,
            name=_name(fit, k),
            line=int(rows.line[k]),
            pose=rows.pose_name[k],
            nest=rows.nest_name[k],
            on_platform=bool(rows.on_platform[k]),
            off_um=_three(off[:, k], bool(rows.placed[k])),
            distance_um=1000.0 * float(np.linalg.norm(linear.residual[rows.live[:, k], k])),
            sigmas=float(np.linalg.norm(linear.whitened[:, k])),
            place_mm=_three(place[:, k], bool(rows.placed[k])),
            left_out=why.get(k, ""),
        )
        for number, k in enumerate(np.flatnonzero(~rows.ghost).tolist(), start=1)
    ]


def _name(fit: Fit, k: int) -> str:
    rows = fit.model.rows
    line = str(rows.line[k])
    return f"{Path(rows.runs[rows.run[k]].source).parent}:{line}" if len(rows.runs) > 1 else line


def _three(values: Array, known: bool) -> tuple[float, float, float]:
    x, y, z = (float(value) if known else float("nan") for value in values)
    return x, y, z


@dataclass(frozen=True)
class NestSummary:
    """Readings of one nest, or of all: ``mean_um`` and ``rms_um`` by axis, and of the distance."""

    nest: str
    count: int
    mean_um: tuple[float, float, float]
    rms_um: tuple[float, float, float]
    distance_um: float


def by_nest(lines: Sequence[ReadingLine]) -> list[NestSummary]:
    """Nest by nest, those on the platform first, then all; readings left out do not count."""
    used = [one for one in lines if not one.left_out and np.isfinite(one.off_um).all()]
    nests = sorted({(not one.on_platform, one.nest) for one in used})
    groups = [(nest, [one for one in used if one.nest == nest]) for _, nest in nests]
    return [_summary(name, group) for name, group in (*groups, ("all", used)) if group]


def _summary(name: str, group: Sequence[ReadingLine]) -> NestSummary:
    off = np.array([one.off_um for one in group])
    return NestSummary(
        name,
        len(group),
        _three(off.mean(axis=0), True),
        _three(np.sqrt((off**2).mean(axis=0)), True),
        float(np.sqrt((off**2).sum(axis=1).mean())),
    )
