"""A serial arm by plain products of frames: where its links are, and what they weigh in its joints.

Written from the chain of a machine file, without the engine. Joint values are in rad (mm where a
joint slides); shapes put poses first.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calib.mechanism.description import Machine
from mocks.physics.pose import Array, Pose

STEPS = 60
"""Newton steps towards a pose."""
CLOSE_MM, CLOSE_RAD = 1e-9, 1e-12
LARGEST_RAD = 0.3
"""A step of a joint towards a pose."""


@dataclass(frozen=True, eq=False)
class Links:
    """Frames along the chain at N instants.

    ``origins`` (E + 1, N, 3) mm and ``axes`` (E + 1, N, 3, 3): before each of the E elements, and
    at the end.
    """

    origins: Array
    axes: Array

    @property
    def pose(self) -> Pose:
        """Where the end of the chain is."""
        return Pose(self.origins[-1], self.axes[-1])


@dataclass(frozen=True, eq=False)
class Arm:
    """One chain with its true parameters: for each element axis, kind, fixed part and drives.

    ``drives`` (E, n): how far an element goes with each actuator.
    """

    axis: tuple[int, ...]
    turns: tuple[bool, ...]
    fixed: Array
    drives: Array

    def links(self, s: Array, grown: Array) -> Links:
        """Frames for extensions (N, n); translations times ``grown`` (N, E)."""
        count = len(s)
        origin, axes = np.zeros((count, 3)), np.tile(np.eye(3), (count, 1, 1))
        origins, every = [origin], [axes]
        for k, (axis, turns) in enumerate(zip(self.axis, self.turns, strict=True)):
            value = self.fixed[k] + s @ self.drives[k]
            if turns:
                axes = axes @ _turns(axis, value)
            else:
                origin = origin + axes[:, :, axis] * (value * grown[:, k])[:, None]
            origins.append(origin)
            every.append(axes)
        return Links(np.array(origins), np.array(every))

    def moved(self, links: Links, element: int, place: Array) -> Array:
        """Velocity (N, n, 3) of points (N, 3) behind an element, per unit of each actuator."""
        out = np.zeros((len(place), self.drives.shape[1], 3))
        for k in range(element + 1):
            for actuator in np.flatnonzero(self.drives[k]):
                along = links.axes[k][:, :, self.axis[k]]
                if self.turns[k]:
                    along = np.cross(along, place - links.origins[k])
                out[:, actuator] += self.drives[k, actuator] * along
        return out

    def turned(self, links: Links) -> Array:
        """Angular velocity (N, n, 3) of the end, per unit of each actuator."""
        out = np.zeros((links.origins.shape[1], self.drives.shape[1], 3))
        for k in np.flatnonzero(self.turns):
            for actuator in np.flatnonzero(self.drives[k]):
                out[:, actuator] += self.drives[k, actuator] * links.axes[k][:, :, self.axis[k]]
        return out

    def reaching(self, wanted: Pose, start: Array) -> Array:
        """Extensions (N, n) at which the end is there, from ``start`` (n,); NaN where it is not."""
        s = np.tile(start, (len(wanted.position), 1))
        grown = np.ones((len(s), len(self.axis)))
        for _ in range(STEPS):
            links = self.links(s, grown)
            away = wanted.position - links.pose.position
            turn = wanted.rotation @ links.pose.rotation.transpose(0, 2, 1)
            twist = _vector(turn)
            end = len(self.axis) - 1
            linear = self.moved(links, end, links.pose.position)
            columns = np.concatenate([linear, self.turned(links)], axis=2).transpose(0, 2, 1)
            scale = np.r_[np.full(3, 1e-3), np.ones(3)]
            gap = np.concatenate([away, twist], axis=1) * scale
            step = np.einsum("nij,nj->ni", np.linalg.pinv(columns * scale[:, None]), gap)
            largest = np.max(np.abs(step), axis=1, keepdims=True)
            s = s + step * np.minimum(1.0, LARGEST_RAD / np.maximum(largest, 1e-300))
        links = self.links(s, grown)
        off = np.linalg.norm(wanted.position - links.pose.position, axis=1)
        askew = np.linalg.norm(
            _vector(wanted.rotation @ links.pose.rotation.transpose(0, 2, 1)), axis=1
        )
        s[(off > 1e3 * CLOSE_MM) | (askew > 1e3 * CLOSE_RAD)] = np.nan
        return s


def arm_of(machine: Machine, parameters: Mapping[str, float]) -> Arm:
    """The chain of a machine file with true parameters, mm and rad."""
    elements = machine.limbs[0].elements
    values = [parameters[p.name] for p in machine.parameters]
    fixed, drives = [], np.zeros((len(elements), len(machine.actuators)))
    for k, element in enumerate(elements):
        value = element.constant
        for term in element.terms:
            if term.kind == "actuator":
                drives[k, term.index] += term.factor
            else:
                value += term.factor * values[term.index]
        fixed.append(value)
    return Arm(
        tuple(e.axis for e in elements), tuple(e.turns for e in elements), np.array(fixed), drives
    )


def _turns(axis: int, angle: Array) -> Array:
    """Rotations (N, 3, 3) about an axis."""
    one, two = (axis + 1) % 3, (axis + 2) % 3
    made = np.zeros((len(angle), 3, 3))
    made[:, axis, axis] = 1.0
    made[:, one, one] = made[:, two, two] = np.cos(angle)
    made[:, two, one] = np.sin(angle)
    made[:, one, two] = -np.sin(angle)
    return made


def _vector(rotation: Array) -> Array:
    """Rotation vectors (N, 3) of rotations by less than half a turn."""
    skew = np.stack(
        [
            rotation[:, 2, 1] - rotation[:, 1, 2],
            rotation[:, 0, 2] - rotation[:, 2, 0],
            rotation[:, 1, 0] - rotation[:, 0, 1],
        ],
        axis=1,
    )
    sine = 0.5 * np.linalg.norm(skew, axis=1)
    angle = np.arctan2(sine, 0.5 * (np.trace(rotation, axis1=1, axis2=2) - 1.0))
    safe = np.where(sine > 1e-12, sine, 1.0)
    factor = np.where(sine > 1e-12, angle / safe, 1.0)
    return np.asarray(0.5 * skew * factor[:, None])
