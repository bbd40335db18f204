"""Any arm as a body of the mock world: one chain whose joints are all driven."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from calib.mechanism.description import Machine
from mocks.hidden.table import Hidden
from mocks.physics.actuators import ActuatorErrors, Load
from mocks.physics.arm import Arm, Links, arm_of
from mocks.physics.body import Place, Surroundings
from mocks.physics.circumstances import REFERENCE_C, Circumstances, Stroke
from mocks.physics.pose import Array, Pose, rotation_from_rpy, rotations_from_rpy
from mocks.physics.truth import nominal_parameters

ARM = "arm"
"""What an arm is called where effects say which machines they are of."""
JOINTS = Stroke(1.0 / 500.0, 2.0 * np.pi, 0.5, 1e9, 9, 1e-6, (-np.pi, np.pi))
AROUND = Surroundings(
    platform_nests={
        "p1": (30.0, 60.0, 0.0),
        "p2": (30.0, -30.0, 52.0),
        "p3": (30.0, -30.0, -52.0),
    },
    base_nests={
        "b1": (300.0, 300.0, 0.0),
        "b2": (-300.0, 300.0, 0.0),
        "b3": (-300.0, -300.0, 0.0),
        "b4": (300.0, -300.0, 60.0),
    },
    place=Place(height=(-700.0, -600.0)),
    load=Load(platform_mass_kg=2.0, platform_com=(40.0, 0.0, 0.0), payload_com=(80.0, 0.0, 20.0)),
)


def is_arm(machine: Machine) -> bool:
    """Whether a machine is one chain whose joints, six or more, are all driven and turn."""
    turning = all(actuator.unit == "rad" for actuator in machine.actuators)
    return (
        turning and len(machine.limbs) == 1 and not machine.joints and len(machine.actuators) >= 6
    )


def joints_of(machine: Machine) -> Stroke:
    """How large things are, with the limits and the gears that the file states."""
    limits = machine.q_limits - machine.reference()[:, None]
    low, high = (tuple(map(float, end)) for end in limits.T)
    gears = tuple(actuator.gear for actuator in machine.actuators)
    return replace(JOINTS, ends=(low, high), gears=gears)


class RealArm:
    """One arm: true parameters and hidden errors."""

    def __init__(
        self,
        machine: Machine,
        parameters: Mapping[str, float],
        hidden: Hidden,
        load: Load,
        settles: bool,
    ) -> None:
        self._arm, self._machine, self._load = arm_of(machine, parameters), machine, load
        names = tuple(axis.name for axis in machine.axes)
        self._actuators = ActuatorErrors(hidden, names, joints_of(machine), settles)
        self._own_growth = hidden.limbs("leg-warming.*", names)
        self._growth = hidden.get("thermal-growth.a")
        self._sag = np.stack([hidden.limbs(f"joint-sag.*.{way}", names) for way in "xy"])

    def home(self, count: int) -> Pose:
        """``count`` copies of the nominal home pose."""
        x, y, z, rx, ry, rz = self._machine.home
        turn = rotation_from_rpy(rx, ry, rz)
        return Pose(np.tile([x, y, z], (count, 1)), np.tile(turn, (count, 1, 1)))

    def poses(self, c: Circumstances, start: Pose) -> Pose:
        """Poses at N instants: what the joints do, then what they give way."""
        warmth = c.structure - REFERENCE_C
        grown = np.ones((len(warmth), len(self._arm.axis)))
        for k in self._machine.limbs[0].traits.grows:
            grown[:, k] += self._growth * warmth
        driven = c.extension + self._actuators.added(c) + warmth[:, None] * self._own_growth
        if not (self._sag.any() or self._actuators.yields):
            return self._arm.links(driven, grown).pose
        yields, lags = self._actuators.softness(c)
        standing = driven
        for _ in range(3):
            links = self._arm.links(standing, grown)
            torque = self.torques(links, c.payload)
            standing = driven + yields * torque + lags * np.abs(torque) + self._hanging(links)
        return self._arm.links(standing, grown).pose

    def torques(self, links: Links, payload: Array) -> Array:
        """What flange, payload and links weigh in each joint, (N, n): N mm, N where it slides."""
        load, gravity = self._load, np.asarray(self._load.gravity)
        end = len(self._arm.axis)
        hung: list[tuple[int, Array | float, tuple[float, float, float]]] = [
            (end, load.platform_mass_kg, load.platform_com),
            (end, payload, load.payload_com),
            *((m.element + 1, m.kg, m.centre) for m in self._machine.limbs[0].traits.masses),
        ]
        total = np.zeros((len(payload), self._arm.drives.shape[1]))
        for frame, mass, centre in hung:
            place = links.origins[frame] + links.axes[frame] @ np.asarray(centre)
            work = self._arm.moved(links, frame - 1, place) @ gravity
            total += np.broadcast_to(np.asarray(mass), payload.shape)[:, None] * work
        return total

    def _hanging(self, links: Links) -> Array:
        """What joints give way by the direction of gravity in the link behind them, (N, n)."""
        gravity = np.asarray(self._load.gravity)
        down = gravity / np.linalg.norm(gravity)
        moved = np.zeros((links.origins.shape[1], self._arm.drives.shape[1]))
        for actuator in range(moved.shape[1]):
            k = int(np.flatnonzero(self._arm.drives[:, actuator])[0])
            # The frame behind the element holds its whole turn; what is fixed in it comes off.
            fixed = -self._arm.fixed[k]
            axes = links.axes[k + 1]
            one, two = (self._arm.axis[k] + 1) % 3, (self._arm.axis[k] + 2) % 3
            x, y = axes[:, :, one] @ down, axes[:, :, two] @ down
            moved[:, actuator] = self._sag[0, actuator] * (
                np.cos(fixed) * x + np.sin(fixed) * y
            ) + self._sag[1, actuator] * (np.cos(fixed) * y - np.sin(fixed) * x)
        return moved


class ArmBody:
    """An arm by its machine file."""

    kind = ARM

    def __init__(self, machine: Machine) -> None:
        self.machine = machine
        self.limbs = tuple(axis.name for axis in machine.axes)
        self.stroke = joints_of(machine)
        self.around = AROUND

    def reference(self, held: Mapping[str, float]) -> Array:
        """q at extension 0, (n,)."""
        return self.machine.reference(held)

    def commanded(self, held: Mapping[str, float], poses: Array) -> Array:
        """q (N, n) for poses (N, 6): x, y, z in mm, rx, ry, rz in rad."""
        arm: Arm = arm_of(self.machine, {**nominal_parameters(self.machine), **held})
        wanted = Pose(np.asarray(poses[:, :3], dtype=float), rotations_from_rpy(poses[:, 3:]))
        reference = self.reference(held)
        return arm.reaching(wanted, self.machine.home_q - reference) + reference

    def real(
        self, parameters: Mapping[str, float], hidden: Hidden, load: Load, settles: bool
    ) -> RealArm:
        """An arm with these true parameters."""
        hidden.check(ARM, self.limbs)
        return RealArm(self.machine, parameters, hidden, load, settles)
