"""Poses on disk: a CSV with one labelled pose a line.

::

    pose,x,y,z,rx,ry,rz
    1,10.0,-5.0,221.5,0.05,-0.1,0.2

mm and rad, platform in the base frame, R = Rz(rz) Ry(ry) Rx(rx); lines that start with # are
remarks.
"""

import csv
import math
from collections.abc import Mapping
from pathlib import Path

from app.files.text import read_text
from calib.errors import BadInput

Pose = tuple[float, float, float, float, float, float]
"""x, y, z in mm and rx, ry, rz in rad: the platform in the base frame."""

HOME = "home"
"""Label of the machine's own home pose; no pose of a file may have it."""

COLUMNS = ("pose", "x", "y", "z", "rx", "ry", "rz")


def read_poses(path: Path) -> dict[str, Pose]:
    """Read labelled poses; raises :class:`BadInput` with file, line and column."""
    lines = [
        (number, line)
        for number, line in enumerate(read_text(path).splitlines(), start=1)
        if line.strip() and not line.startswith("#")
    ]
    if not lines:
        raise BadInput("no poses", place=str(path), remedy=f"Start with {','.join(COLUMNS)}")
    numbers = [number for number, _ in lines]
    rows = list(csv.reader(line for _, line in lines))
    if tuple(cell.strip() for cell in rows[0]) != COLUMNS:
        raise BadInput(
            f"the header is {','.join(rows[0])}",
            place=f"{path}, line {numbers[0]}",
            remedy=f"Write {','.join(COLUMNS)}",
        )
    poses: dict[str, Pose] = {}
    for number, row in zip(numbers[1:], rows[1:], strict=True):
        place = f"{path}, line {number}"
        if len(row) != len(COLUMNS):
            raise BadInput(f"{len(row)} columns, not {len(COLUMNS)}", place=place)
        label = row[0].strip()
        if not label or label == HOME or label in poses:
            raise BadInput(
                f'label "{label}" is empty, reserved or there already',
                place=f"{place}, column pose",
                remedy="Give every pose its own label",
            )
        poses[label] = _pose(row, place)
    if not poses:
        raise BadInput("a header and no poses", place=str(path), remedy="Add poses")
    return poses


def _pose(row: list[str], place: str) -> Pose:
    values = []
    for name, cell in zip(COLUMNS[1:], row[1:], strict=True):
        try:
            value = float(cell)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise BadInput(
                f'"{cell}" is not a finite number', place=f"{place}, column {name}"
            ) from None
        values.append(value)
    x, y, z, rx, ry, rz = values
    return x, y, z, rx, ry, rz


def poses_text(poses: Mapping[str, Pose]) -> str:
    """Write poses as the text of a poses file."""
    lines = [",".join(COLUMNS)]
    lines += [",".join([label, *(f"{v:.9g}" for v in pose)]) for label, pose in poses.items()]
    return "\n".join(lines) + "\n"
