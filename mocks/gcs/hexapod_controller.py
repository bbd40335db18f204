"""A closed hexapod's controller: takes poses, computes with the drawn geometry, shows none of it.

Axes X Y Z in mm, U V W in degrees; all 0 where the drawn platform is at home. It knows where it
is only after a reference move, and forgets that, its pivot and its coordinate systems with the
power. All six servos are switched together.
"""

from collections.abc import Mapping, Sequence

import numpy as np

from mocks.canopen.hexapod_kinematics import HexapodKinematics
from mocks.canopen.ports import Machine
from mocks.canopen.unreachable import Unreachable
from mocks.gcs.errors import Code, GcsError
from mocks.gcs.hexapod_frames import STILL, Motion, Systems
from mocks.physics.hexapod import HOME_Z, forward, geometry, home_pose
from mocks.physics.pose import Array, Pose, rpy_from_rotation

AXES = "XYZUVW"
LIMITS = {
    **dict.fromkeys("XY", (-30.0, 30.0)), "Z": (-22.0, 22.0),
    **dict.fromkeys("UV", (-25.0, 25.0)), "W": (-30.0, 30.0),
}  # fmt: skip
ZERO_AT = np.array([0.0, 0.0, HOME_Z])
LEG_MM = (195.0, 265.0)
USUAL_MM_S, FASTEST_MM_S = 10.0, 50.0
REFERENCE_MM_S, REFERENCE_S, BOOT_S = 5.0, 3.0, 2.0
WINDOW_MM, FOLLOWING_MM, FOLLOWING_S, SHORTEST_MOVE_S = 0.0005, 0.05, 0.1, 0.01
# Quintic motion: largest speed as a multiple of way/time.
PEAK_SPEED = 1.875


class HexapodController:
    """State and motion; not thread-safe, the server holds its lock.

    Parameters
    ----------
    machine : Machine
        Six legs: extension 0 is the reference.
    nominal : mapping
        The drawn geometry by name, which is all that it knows.
    serial : int
    """

    def __init__(self, machine: Machine, nominal: Mapping[str, float], serial: int) -> None:
        self.machine = machine
        self.serial = serial
        self._nominal = dict(nominal)
        self._kinematics = HexapodKinematics()
        self._geometry = geometry(self._nominal)
        self._home = np.array([self._kinematics.reference(n, self._nominal) for n in range(6)])
        self._near: Pose = home_pose(1)
        self.power_on()

    def power_on(self) -> None:
        """Come up without power on the motors and without a reference."""
        self.servo = self.referenced = self.referencing = False
        self.systems, self.velocity, self.error = Systems(), USUAL_MM_S, 0
        self._late_since: float | None = None
        self._boots_until = self.machine.clock.now() + BOOT_S
        self.halt()

    # ------------------------------------------------------------ state

    @property
    def booting(self) -> bool:
        """Whether it is not ready after power-on."""
        return self.machine.clock.now() < self._boots_until

    @property
    def busy(self) -> bool:
        """Whether it boots or looks for its reference."""
        return self.booting or self.referencing

    @property
    def moving(self) -> bool:
        """Whether any leg is under way."""
        return self.referencing or any(leg.moving for leg in self.machine.legs)

    def motion_mask(self) -> int:
        """Bit n of the axes in the order of ``SAI?``: all move, or none does."""
        return (1 << len(AXES)) - 1 if self.moving else 0

    @property
    def on_target(self) -> bool:
        """Whether it rests at its target."""
        off = [abs(leg.position() - leg.target) for leg in self.machine.legs]
        return self.servo and not self.moving and max(off) <= WINDOW_MM

    def place(self) -> tuple[float, ...]:
        """Where it believes to be, from its encoders and the drawn geometry."""
        return self.systems.write(self._motion([leg.position() for leg in self.machine.legs]))

    def target(self) -> tuple[float, ...]:
        """What it is bound for."""
        return self.systems.write(self._goal)

    def _motion(self, extension: Sequence[float]) -> Motion:
        lengths: Array = (self._home + np.asarray(extension))[None, :]
        self._near, _ = forward(self._geometry, lambda legs, pose: lengths, self._near)
        return self._near.rotation[0], self._near.position[0] - ZERO_AT

    # ------------------------------------------------------------ motion

    def can_go(self, targets: Mapping[str, float]) -> bool:
        """Whether axes and legs allow it."""
        try:
            self._legs_at(self._whole(targets))
        except GcsError:
            return False
        return True

    def move(self, targets: Mapping[str, float]) -> None:
        """Start towards targets, all legs arriving together; raises GcsError, moving nothing.

        Axes that are not named keep their targets.
        """
        if not self.servo or not self.referenced or self.referencing:
            raise GcsError(Code.NOT_REFERENCED_OR_NO_SERVO)
        written = self._whole(targets)
        places = self._legs_at(written)
        self._goal = self.systems.read(written)
        self._send(places, self.velocity, SHORTEST_MOVE_S)

    def _whole(self, targets: Mapping[str, float]) -> list[float]:
        return [targets.get(axis, at) for axis, at in zip(AXES, self.target(), strict=True)]

    def _legs_at(self, written: Sequence[float]) -> Array:
        for axis, value in zip(AXES, written, strict=True):
            low, high = LIMITS[axis]
            if not low <= value <= high:
                raise GcsError(Code.OUT_OF_LIMITS)
        turn, place = self.systems.read(written)
        pose = [*(place + ZERO_AT), *rpy_from_rotation(turn[None])[0]]
        try:
            lengths = np.array(self._kinematics.targets(pose, self._nominal))
        except Unreachable as error:
            raise GcsError(Code.OUT_OF_LIMITS) from error
        if not np.all((lengths >= LEG_MM[0]) & (lengths <= LEG_MM[1])):
            raise GcsError(Code.OUT_OF_LIMITS)
        return np.asarray(lengths - self._home)

    def _send(self, places: Array, velocity: float, least_s: float) -> None:
        way = [abs(p - leg.position()) for p, leg in zip(places, self.machine.legs, strict=True)]
        duration = max(least_s, PEAK_SPEED * max(way) / velocity)
        for place, leg in zip(places, self.machine.legs, strict=True):
            leg.command(float(place), duration)

    def halt(self) -> None:
        """Brake; where it comes to rest is its target."""
        for leg in self.machine.legs:
            leg.stop()
        self.referencing = False
        rest = [leg.position() if leg.stalled else leg.target for leg in self.machine.legs]
        try:
            self._goal = self._motion(rest)
        except ArithmeticError:
            self._goal = STILL

    def stop(self) -> None:
        """Stop everything now; ``ERR?`` answers 10 then."""
        self.halt()
        self.error = Code.STOPPED

    def switch(self, on: bool) -> None:
        """Switch all servos; off acknowledges a fault whose cause is gone."""
        if not on:
            self.halt()
        elif self._broken():
            raise GcsError(Code.MOTION_ERROR)
        self.servo = on

    def reference(self) -> None:
        """Start the reference move, which is one for all axes."""
        if not self.servo:
            raise GcsError(Code.NOT_REFERENCED_OR_NO_SERVO)
        self.referenced, self.referencing = False, True
        self._goal = STILL
        self._send(np.zeros(len(self.machine.legs)), REFERENCE_MM_S, REFERENCE_S)

    def set_velocity(self, velocity: float) -> None:
        """Set the velocity of the platform, mm/s."""
        if not 0.0 < velocity <= FASTEST_MM_S:
            raise GcsError(Code.VELOCITY)
        self.velocity = velocity

    def need_rest(self) -> None:
        """Refuse what must not be done in motion."""
        if self.moving:
            raise GcsError(Code.HEXAPOD_IN_MOTION)

    # ------------------------------------------------------------ what happens by itself

    def heard(self) -> None:
        """Something came from the PC: this controller does not care."""

    def tick(self) -> None:
        """Look at the legs; called many times a second."""
        faults = self.machine.faults
        if "power-cycle" in faults:
            self.power_on()
            faults.take("power-cycle")  # only now: the power is back
        for number in range(1, len(self.machine.legs) + 1):
            if faults.take(f"reference-lost:{number}"):
                self.referenced = False
        if self.referencing and not any(leg.moving for leg in self.machine.legs):
            self.referencing = False
            self.referenced = max(abs(leg.position()) for leg in self.machine.legs) <= WINDOW_MM
        if self.servo and (self._broken() or self._follows_badly()):
            self.halt()
            self.servo, self.error = False, Code.MOTION_ERROR

    def _broken(self) -> bool:
        return bool(self.machine.faults.arguments("drive-fault"))

    def _follows_badly(self) -> bool:
        late = any(
            leg.stalled and abs(leg.position() - leg.target) > FOLLOWING_MM
            for leg in self.machine.legs
        )
        now = self.machine.clock.now()
        if not late:
            self._late_since = None
        elif self._late_since is None:
            self._late_since = now
        return self._late_since is not None and now - self._late_since >= FOLLOWING_S
