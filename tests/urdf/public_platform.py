"""A six-legged platform as a URDF in a simulator's style, and its legs' lengths in closed form.

Joint centres are the corners of two hexagons (m). The tree carries the platform on the first leg;
the other five end in the air, and the list of constraints closes them by ball joints.
"""

import numpy as np

from calib.arrays import Array

BASE_M, PLATE_M, HEIGHT_M = 0.30, 0.15, 0.35
BASE_DEG = (-20.0, 20.0, 100.0, 140.0, 220.0, 260.0)
PLATE_DEG = (-50.0, 50.0, 70.0, 170.0, 190.0, 290.0)


def on_circle(radius: float, degrees: tuple[float, ...]) -> Array:
    """Corners (6, 3), m."""
    angles = np.radians(degrees)
    return np.stack([radius * np.cos(angles), radius * np.sin(angles), 0.0 * angles], axis=1)


FEET, HEADS = on_circle(BASE_M, BASE_DEG), on_circle(PLATE_M, PLATE_DEG)
UP = np.array([0.0, 0.0, HEIGHT_M])


def lengths(position: Array, rotation: Array) -> Array:
    """Legs (6,), m, of the platform at a pose."""
    return np.asarray(np.linalg.norm(position + HEADS @ rotation.T - FEET, axis=1))


def leaning(leg: int) -> tuple[float, float, float]:
    """Turns about x and then y of a leg at home, and its length: z along it."""
    along = UP + HEADS[leg] - FEET[leg]
    size = float(np.linalg.norm(along))
    x, y, z = along / size
    return float(np.arctan2(-y, z)), float(np.arcsin(x)), size


def joint(name: str, kind: str, parent: str, child: str, xyz: Array | None = None,
          axis: str = "", limit: str = "") -> str:  # fmt: skip
    """A joint of a URDF."""
    place = " ".join(map(repr, map(float, np.zeros(3) if xyz is None else xyz)))
    more = f'<axis xyz="{axis}"/>' if axis else ""
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{place}"/>{more}{limit}</joint>'
    )


def platform_urdf() -> str:
    """The tree."""
    lines = ['<robot name="platform">', '<link name="base"/>']
    for leg in range(6):
        n = leg + 1
        limit = '<limit lower="0.2" upper="0.6" effort="1" velocity="1"/>'
        lines += [
            joint(f"foot{n}_x", "continuous", "base", f"cross{n}", FEET[leg], "1 0 0"),
            joint(f"foot{n}_y", "continuous", f"cross{n}", f"tube{n}", None, "0 1 0"),
            joint(f"slide{n}", "prismatic", f"tube{n}", f"rod{n}", None, "0 0 1", limit),
        ]
    lines += [
        joint("head1_z", "continuous", "rod1", "yoke1", None, "0 0 1"),
        joint("head1_y", "continuous", "yoke1", "yoke2", None, "0 1 0"),
        joint("head1_x", "continuous", "yoke2", "yoke3", None, "-1 0 0"),
        joint("bolted", "fixed", "yoke3", "plate", -HEADS[0]),
    ]
    return "\n".join([*lines, "</robot>"])


def platform_loops(joint_kind: str = "ball") -> str:
    """The list of constraints, in TOML."""
    home = {}
    for leg in range(6):
        home[f"foot{leg + 1}_x"], home[f"foot{leg + 1}_y"], home[f"slide{leg + 1}"] = leaning(leg)
    a, b, _ = leaning(0)
    # The first leg's ball undoes its lean: Rx(a) Ry(b) Rz(0) Ry(-b) R-x(a) = 1.
    home |= {"head1_z": 0.0, "head1_y": -b, "head1_x": a}
    lines = [
        'platform = "plate"',
        f"actuated = {[f'slide{n}' for n in range(1, 7)]}".replace("'", '"'),
        "[home]",
        *(f"{name} = {value!r}" for name, value in home.items()),
    ]
    for n in range(2, 7):
        lines += [
            "[[loop]]", f'from = "rod{n}"', 'to = "plate"', f"to_xyz = {HEADS[n - 1].tolist()}",
            f'joint = "{joint_kind}"',
        ]  # fmt: skip
    return "\n".join(lines) + "\n"
