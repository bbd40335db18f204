"""A first guess from the home configuration, to second order in what is asked.

Every forward solution that starts at home would begin with the same linearisation. Its answer,
and the curvature behind it, are worked out once for a machine from solutions near home; a guess
then costs one matrix product. It only starts Newton: the result does not depend on it. The
compiled core guesses in the same way, and for an inverse that goes limb by limb as well.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, BoolArray
from calib.mechanism.description import Machine
from calib.mechanism.rigid import Poses, exponential, logarithm, product
from calib.mechanism.tables import passive_units

PROBE = 0.02
"""Distance of the probes from home, as a part of each stroke."""
LARGEST_LINEAR, LARGEST_QUADRATIC = 1.0, 0.2
"""Beyond these (rad, or parts of the machine's size) the series says nothing: stay at home."""


def _pairs(n: int) -> list[tuple[int, int]]:
    return [(i, j) for i in range(n) for j in range(i)]


def probe_steps(machine: Machine) -> Array:
    """Extensions relative to home (n, n (n + 3) / 2): + and - each actuator, + each pair."""
    low, high = machine.q_limits.T
    return _probes(PROBE * (high - low))


def pose_probes(home: Poses, size: float) -> tuple[Array, Poses]:
    """Small steps (6, 27) of the pose about ``home`` (one pose), and the poses that they lead to.

    A step is the way of the origin over ``size``, and the rotation vector to first order
    (:func:`calib.mechanism.rigid.small_rotation`).
    """
    steps = _probes(np.full(6, PROBE))
    sine = np.sqrt(np.sum(steps[3:] ** 2, axis=0))
    turned = np.where(sine > 0.0, np.arcsin(sine) / np.where(sine > 0.0, sine, 1.0), 1.0)
    rotation = product(exponential(steps[3:] * turned), home.rotation)
    return steps, Poses(home.position + steps[:3] * size, rotation)


def _probes(h: Array) -> Array:
    n = len(h)
    pairs = _pairs(n)
    steps = np.zeros((n, 2 * n + len(pairs)))
    steps[np.arange(n), np.arange(n)] = h
    steps[np.arange(n), n + np.arange(n)] = -h
    for k, (i, j) in enumerate(pairs):
        steps[[i, j], 2 * n + k] = h[[i, j]]
    return steps


def coefficients(steps: Array, y: Array) -> tuple[Array, Array]:
    """Linear (m, n) and quadratic (m, n (n + 1) / 2) answers, from y (m, ...) at the probes."""
    n = len(steps)
    h = np.diag(steps[:, :n])
    plus, minus, pairs = y[:, :n], y[:, n : 2 * n], y[:, 2 * n :]
    quadratic = [0.5 * (plus + minus) / h**2]
    for k, (i, j) in enumerate(_pairs(n)):
        mixed = pairs[:, k] - plus[:, i] - plus[:, j]
        quadratic.append((mixed / (h[i] * h[j]))[:, None])
    return 0.5 * (plus - minus) / h, np.concatenate(quadratic, axis=1)


@dataclass(frozen=True, eq=False)
class Extrapolation:
    """Second-order series of position / size, rotation vector and passive coordinates.

    ``linear`` (6 + n_joints, n) and ``quadratic`` (6 + n_joints, n (n + 1) / 2); ``unit``
    (6 + n_joints, 1) is what counts as one: 1 rad, or the machine's size.
    """

    position: Array
    rotation: Array
    passive: Array
    linear: Array
    quadratic: Array
    unit: Array
    size: float

    @classmethod
    def fit(
        cls,
        machine: Machine,
        home: tuple[Array, Array, Array],
        probes: tuple[Array, Array, Array],
    ) -> "Extrapolation":
        """Differences of the probes; both as position (3, N), rotation (3, 3, N), passive (J, N).

        ``home`` holds one configuration and ``probes`` those of :func:`probe_steps`.
        """
        position, rotation, passive = home
        y = np.concatenate(
            [
                (probes[0] - position) / machine.size,
                logarithm(product(probes[1], np.swapaxes(rotation, 0, 1))),
                probes[2] - passive,
            ]
        )
        linear, quadratic = coefficients(probe_steps(machine), y)
        return cls(
            position,
            rotation,
            passive,
            linear,
            quadratic,
            np.concatenate([np.ones(6), passive_units(machine)])[:, None],
            machine.size,
        )

    def guess(self, steps: Array) -> tuple[Array, Array, Array]:
        """Position (3, N), rotation (3, 3, N), passive (J, N) at ``steps`` (n, N) from home."""
        n = len(steps)
        products = [steps**2, *((steps[i] * steps[j])[None] for i, j in _pairs(n))]
        first = self.linear @ steps
        second = self.quadratic @ np.concatenate(products)
        trusted = self._trusted(first, second)
        y = np.where(trusted, first + second, 0.0)
        return (
            self.position + y[:3] * self.size,
            product(exponential(y[3:6]), self.rotation),
            self.passive + y[6:],
        )

    def _trusted(self, first: Array, second: Array) -> BoolArray:
        largest = np.max(np.abs(first) / self.unit, axis=0)
        curved = np.max(np.abs(second) / self.unit, axis=0)
        trusted: BoolArray = (largest < LARGEST_LINEAR) & (curved < LARGEST_QUADRATIC)
        return trusted
