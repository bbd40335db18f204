"""Two public arms by the parameters that their makers publish, as URDF and as plain products.

UR5e: Denavit and Hartenberg's parameters, https://www.universal-robots.com (DH parameters for
calculations of kinematics and dynamics). Panda: Craig's convention, Franka's control
documentation ("Denavit-Hartenberg parameters"). Lengths in m.
"""

import numpy as np

from calib.arrays import Array

HALF = np.pi / 2
UR5E = (
    # a, alpha, d
    (0.0, HALF, 0.1625),
    (-0.425, 0.0, 0.0),
    (-0.3922, 0.0, 0.0),
    (0.0, HALF, 0.1333),
    (0.0, -HALF, 0.0997),
    (0.0, 0.0, 0.0996),
)
PANDA = (
    # a and alpha before the joint, d behind it
    (0.0, 0.0, 0.333),
    (0.0, -HALF, 0.0),
    (0.0, HALF, 0.316),
    (0.0825, HALF, 0.0),
    (-0.0825, -HALF, 0.384),
    (0.0, HALF, 0.0),
    (0.088, HALF, 0.0),
)
FLANGE = 0.107
LIMITS = {
    "ur5e": [(-6.28, 6.28)] * 6,
    "panda": [(-2.8973, 2.8973), (-1.7628, 1.7628), (-2.8973, 2.8973), (-3.0718, -0.0698),
              (-2.8973, 2.8973), (-0.0175, 3.7525), (-2.8973, 2.8973)],
}  # fmt: skip


def turn(axis: str, angle: float) -> Array:
    made = np.eye(4)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    made[i, i] = made[j, j] = np.cos(angle)
    made[i, j], made[j, i] = -np.sin(angle), np.sin(angle)
    return made


def shift(x: float, y: float, z: float) -> Array:
    made = np.eye(4)
    made[:3, 3] = x, y, z
    return made


def flange_of(arm: str, q: Array) -> Array:
    """Flange (4, 4) in m by the published formulas."""
    at = np.eye(4)
    if arm == "ur5e":
        for (a, alpha, d), value in zip(UR5E, q, strict=True):
            at = at @ turn("z", value) @ shift(0, 0, d) @ shift(a, 0, 0) @ turn("x", alpha)
        return at
    for (a, alpha, d), value in zip(PANDA, q, strict=True):
        at = at @ turn("x", alpha) @ shift(a, 0, 0) @ turn("z", value) @ shift(0, 0, d)
    return at @ shift(0, 0, FLANGE)


def urdf_of(arm: str) -> str:
    """The same as a URDF: each joint's frame in the one before."""
    if arm == "ur5e":
        before = [(0.0, 0.0, 0.0), *UR5E[:-1]]
        origins = [f'xyz="{a} 0 {d}" rpy="{alpha} 0 0"' for a, alpha, d in before]
        a, alpha, d = UR5E[-1]
        last = f'xyz="{a} 0 {d}" rpy="{alpha} 0 0"'
    else:
        origins, behind = [], 0.0
        for a, alpha, d in PANDA:
            # The shift along the joint before, then the turn about x: both in the parent's frame.
            origins.append(f'xyz="{a} 0 {behind}" rpy="{alpha} 0 0"')
            behind = d
        last = f'xyz="0 0 {behind + FLANGE}" rpy="0 0 0"'
    count = len(origins)
    lines = [f'<robot name="{arm}">', '<link name="world"/>']
    lines += [f'<link name="l{k}"/>' for k in range(count + 1)]
    lines.append('<link name="tool"/>')
    lines.append('<joint name="fix" type="fixed"><parent link="world"/><child link="l0"/></joint>')
    for k, (origin, (low, high)) in enumerate(zip(origins, LIMITS[arm], strict=True)):
        lines.append(
            f'<joint name="joint{k + 1}" type="revolute"><parent link="l{k}"/>'
            f'<child link="l{k + 1}"/><origin {origin}/><axis xyz="0 0 1"/>'
            f'<limit lower="{low}" upper="{high}" effort="150" velocity="3"/></joint>'
        )
    lines.append(
        f'<joint name="flange" type="fixed"><parent link="l{count}"/><child link="tool"/>'
        f"<origin {last}/></joint></robot>"
    )
    return "\n".join(lines)
