"""Rotations as LinuxCNC's genhexkins and this program both make them."""

import math


def matrix(rx: float, ry: float, rz: float) -> tuple[float, ...]:
    """R = Rz(rz) Ry(ry) Rx(rx), row after row; angles in rad."""
    (cx, sx), (cy, sy), (cz, sz) = ((math.cos(a), math.sin(a)) for a in (rx, ry, rz))
    return (
        cz * cy, cz * sy * sx - sz * cx, cz * sy * cx + sz * sx,
        sz * cy, sz * sy * sx + cz * cx, sz * sy * cx - cz * sx,
        -sy, cy * sx, cy * cx,
    )  # fmt: skip
