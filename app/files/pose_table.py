"""Poses on disk: a CSV with one labelled pose a line.

::

    pose,x,y,z,rx,ry,rz
    1,10.0,-5.0,221.5,0.05,-0.1,0.2

mm and rad, platform in the base frame, R = Rz(rz) Ry(ry) Rx(rx); lines that start with # are
remarks.
"""

from collections.abc import Mapping
from pathlib import Path

from app.files.unit_columns import number_in, table_lines
from calib.errors import BadInput
from calib.quantity import in_short

Pose = tuple[float, float, float, float, float, float]
"""x, y, z in mm and rx, ry, rz in rad: the platform in the base frame."""

HOME = "home"
"""Label of the machine's own home pose; no pose of a file may have it."""

COLUMNS = ("pose", "x", "y", "z", "rx", "ry", "rz")


def read_poses(path: Path) -> dict[str, Pose]:
    """Read labelled poses; raises :class:`BadInput` with file, line and column."""
    rows = table_lines(path)
    place, header = next(rows, (str(path), ()))
    if not header:
        raise BadInput("no poses", place=place, remedy=f"Start with {','.join(COLUMNS)}")
    if tuple(header) != COLUMNS:
        raise BadInput(
            f"the header is {in_short(','.join(header))}",
            place=place,
            remedy=f"Write {','.join(COLUMNS)}",
        )
    poses: dict[str, Pose] = {}
    for place, row in rows:
        if len(row) != len(COLUMNS):
            raise BadInput(
                f"{len(row)} columns, not {len(COLUMNS)}",
                place=place,
                remedy=f"Write {','.join(COLUMNS)}",
            )
        label = row[0]
        if not label or label == HOME or label in poses:
            raise BadInput(
                f'label "{label}" is empty, reserved or there already',
                place=f"{place}, column pose",
                remedy="Give every pose its own label",
            )
        x, y, z, rx, ry, rz = (
            number_in(cell, f"{place}, column {name}")
            for name, cell in zip(COLUMNS[1:], row[1:], strict=True)
        )
        poses[label] = x, y, z, rx, ry, rz
    if not poses:
        raise BadInput("a header and no poses", place=str(path), remedy="Add poses")
    return poses


def poses_text(poses: Mapping[str, Pose]) -> str:
    """Write poses as the text of a poses file."""
    lines = [",".join(COLUMNS)]
    lines += [",".join([label, *(f"{v:.9g}" for v in pose)]) for label, pose in poses.items()]
    return "\n".join(lines) + "\n"
