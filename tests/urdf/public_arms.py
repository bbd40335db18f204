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
UR5E_KG = (3.761, 8.058, 2.846, 1.37, 1.3, 0.365)
UR5E_COM = (
    # in the frame behind each joint's a, alpha, d
    (0.0, -0.02561, 0.00193),
    (0.2125, 0.0, 0.11336),
    (0.15, 0.0, 0.0265),
    (0.0, -0.0018, 0.01634),
    (0.0, 0.0018, 0.01634),
    (0.0, 0.0, -0.001159),
)
GEAR = 101
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


def heavy_ur5e() -> str:
    """The URDF of a UR5e with what its links weigh, and with gears."""
    text = urdf_of("ur5e")
    for k, ((a, alpha, d), kg, com) in enumerate(zip(UR5E, UR5E_KG, UR5E_COM, strict=True)):
        at = shift(0, 0, d) @ shift(a, 0, 0) @ turn("x", alpha)
        x, y, z = (at @ np.append(com, 1.0))[:3]
        link = f'<link name="l{k + 1}"'
        text = text.replace(
            f"{link}/>",
            f'{link}><inertial><origin xyz="{x} {y} {z}"/><mass value="{kg}"/></inertial></link>',
        )
        text = text.replace(
            "</robot>",
            f'<transmission name="t{k}"><joint name="joint{k + 1}"/><actuator name="m{k}">'
            f"<mechanicalReduction>{GEAR}</mechanicalReduction></actuator></transmission></robot>",
        )
    return text


def torques_of_ur5e(q: Array) -> Array:
    """Torque (6,) of the links' weight about each joint, N mm, from their centres of mass."""
    at, axes, centres = np.eye(4), [], []
    for (a, alpha, d), value, com in zip(UR5E, q, UR5E_COM, strict=True):
        axes.append((at[:3, 3], at[:3, 2]))
        at = at @ turn("z", value) @ shift(0, 0, d) @ shift(a, 0, 0) @ turn("x", alpha)
        centres.append((at @ np.append(com, 1.0))[:3])
    weight = [np.array([0.0, 0.0, -9.80665 * kg]) for kg in UR5E_KG]
    return np.array([
        1000.0 * sum(
            axis @ np.cross(centre - foot, force)
            for centre, force in list(zip(centres, weight, strict=True))[k:]
        )
        for k, (foot, axis) in enumerate(axes)
    ])  # fmt: skip


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
