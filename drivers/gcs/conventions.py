"""How a closed controller writes a pose down: its order of rotations, its unit, its pivot.

Ours: x, y, z in mm of the platform's origin in the base frame; rx, ry, rz in rad with
R = Rz(rz) Ry(ry) Rx(rx). The controller's: X, Y, Z in mm and U, V, W about x, y and z, all 0 at its
zero, where the platform's origin stands at ``origin`` and its axes are parallel to the base's.
A turn leaves the pivot c (in the controller's frame) where it is, so ::

    X = o - origin - c + R c        o: the platform's origin in the base frame

The order of rotations is the product of matrices from left to right: "Rx Ry Rz" is R = Rx(U)
Ry(V) Rz(W), turns about axes that move along, first x, then the new y, then the new z.
"""

import math
from dataclasses import dataclass, replace

Vector = tuple[float, float, float]
Rows = tuple[Vector, Vector, Vector]
OURS = "Rz Ry Rx"
ROTATION = "order of its rotations as a product of matrices, from left to right"
ORDERS = ("Rx Ry Rz", "Rx Rz Ry", "Ry Rx Rz", "Ry Rz Rx", "Rz Rx Ry", OURS)


def rotation(angles: Vector, order: str) -> Rows:
    """Rows of the matrix that turns by ``angles`` (about x, y, z; rad) in an order of ORDERS."""
    turn: Rows = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    for axis in _axes(order):
        turn = _product(turn, _about(axis, angles[axis]))
    return turn


def angles(rows: Rows, order: str) -> Vector:
    """Angles about x, y, z (rad) with :func:`rotation` = ``rows``; the middle one within 90 deg.

    With even = 1 for an order that goes round as x y z does, else -1, the product of matrices
    about axes i, j, k has R[i][k] = even sin(b), R[j][k] = -even sin(a) cos(b) and
    R[i][j] = -even cos(b) sin(c), R[k][k] = cos(a) cos(b), R[i][i] = cos(b) cos(c).
    """
    i, j, k = _axes(order)
    even = 1.0 if (j - i) % 3 == 1 else -1.0
    found = [0.0, 0.0, 0.0]
    found[i] = math.atan2(-even * rows[j][k], rows[k][k])
    found[j] = math.atan2(even * rows[i][k], math.hypot(rows[i][i], rows[i][j]))
    found[k] = math.atan2(-even * rows[i][j], rows[i][i])
    return found[0], found[1], found[2]


def _axes(order: str) -> list[int]:
    return ["xyz".index(word[1]) for word in order.split()]


def _about(axis: int, angle: float) -> Rows:
    cos, sin = math.cos(angle), math.sin(angle)
    j, k = (axis + 1) % 3, (axis + 2) % 3
    turn = [[0.0] * 3 for _ in range(3)]
    turn[axis][axis] = 1.0
    turn[j][j], turn[j][k], turn[k][j], turn[k][k] = cos, -sin, sin, cos
    return (_vector(turn[0]), _vector(turn[1]), _vector(turn[2]))


def _vector(values: list[float]) -> Vector:
    return values[0], values[1], values[2]


def _product(a: Rows, b: Rows) -> Rows:
    columns = list(zip(*b, strict=True))
    rows = [_vector([math.fsum(p * q for p, q in zip(r, c, strict=True)) for c in columns])
            for r in a]  # fmt: skip
    return rows[0], rows[1], rows[2]


def _turned(rows: Rows, v: Vector) -> Vector:
    return _vector([sum(p * q for p, q in zip(row, v, strict=True)) for row in rows])


@dataclass(frozen=True)
class Convention:
    """How one controller writes poses down.

    Attributes
    ----------
    order : str
        One of ORDERS.
    degrees : bool
        Whether its angles are in degrees.
    origin, pivot : tuple of float
        See above; mm.
    """

    order: str
    degrees: bool = True
    origin: Vector = (0.0, 0.0, 0.0)
    pivot: Vector = (0.0, 0.0, 0.0)

    def about(self, pivot: Vector) -> "Convention":
        """The same about another pivot."""
        return replace(self, pivot=pivot)

    def written(self, pose: tuple[float, ...]) -> tuple[float, ...]:
        """X, Y, Z, U, V, W of one of our poses."""
        turn = rotation((pose[3], pose[4], pose[5]), OURS)
        carried = _turned(turn, self.pivot)
        place = [pose[n] - self.origin[n] - self.pivot[n] + carried[n] for n in range(3)]
        unit = math.degrees if self.degrees else float
        return (*place, *(unit(angle) for angle in angles(turn, self.order)))

    def read(self, values: tuple[float, ...]) -> tuple[float, ...]:
        """Our pose at X, Y, Z, U, V, W."""
        unit = math.radians if self.degrees else float
        turn = rotation((unit(values[3]), unit(values[4]), unit(values[5])), self.order)
        carried = _turned(turn, self.pivot)
        place = [values[n] + self.origin[n] + self.pivot[n] - carried[n] for n in range(3)]
        return (*place, *angles(turn, OURS))
