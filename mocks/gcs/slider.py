"""One slider with its servo amplifier: power, reference, following error."""

from mocks.canopen.ports import Leg, Machine
from mocks.gcs.tripod_kinematics import HOME

WINDOW_MM = 0.0005
"""On target within this."""
FOLLOWING_MM, FOLLOWING_S = 0.05, 0.1
"""A servo that is this far from its set-point for so long switches itself off."""
# Quintic motion: largest speed as a multiple of way/time.
PEAK_SPEED = 1.875
SHORTEST_MOVE_S = 0.01
# Bits of the status register (SRG? axis 1, #4).
ERROR, SERVO, MOVING, REFERENCING, ON_TARGET = 1 << 8, 1 << 12, 1 << 13, 1 << 14, 1 << 15


class Slider:
    """Slider of limb ``number`` (from 1); places are q in mm, 410 at home."""

    def __init__(self, number: int, machine: Machine) -> None:
        self.number = number
        self.servo = False
        self.fault = False
        self.referenced = True
        self.referencing = False
        self.velocity = 20.0
        self.target = HOME
        self._machine = machine
        self._leg: Leg = machine.legs[number - 1]
        self._late_since: float | None = None

    @property
    def place(self) -> float:
        """Where it stands now, as its encoder reads it."""
        return HOME + self._leg.position()

    @property
    def moving(self) -> bool:
        """Whether it is under way."""
        return self._leg.moving

    @property
    def on_target(self) -> bool:
        """Whether it rests at its target."""
        return self.servo and not self.moving and abs(self.place - self.target) <= WINDOW_MM

    def register(self) -> int:
        """Return the status register."""
        bits = ERROR if self.fault else 0
        bits |= SERVO if self.servo else 0
        bits |= MOVING if self.moving else 0
        bits |= REFERENCING if self.referencing else 0
        return bits | (ON_TARGET if self.on_target else 0)

    def duration(self, target: float) -> float:
        """Machine seconds to go to ``target``."""
        return max(SHORTEST_MOVE_S, PEAK_SPEED * abs(target - self.place) / self.velocity)

    def go(self, target: float, duration_s: float) -> None:
        """Be at ``target`` in ``duration_s`` of machine time."""
        self.target = target
        self._leg.command(target - HOME, duration_s)

    def halt(self) -> None:
        """Brake; where it comes to rest is its target."""
        self._leg.stop()
        self.referencing = False
        self.target = HOME + self._leg.target if not self._leg.stalled else self.place

    def switch(self, on: bool) -> bool:
        """Switch the servo; off acknowledges a fault whose cause is gone. Whether it could be."""
        if not on:
            self.halt()
            self.servo = False
            self.fault = self.fault and self._broken()
            return True
        if self.fault:
            return False
        if not self.servo:
            self.halt()
        self.servo = True
        return True

    def reference(self) -> None:
        """Go to the reference mark, which is at 410."""
        self.referenced, self.referencing = False, True
        self.go(HOME, self.duration(HOME))

    def tick(self) -> bool:
        """Look at the slider; True if it has just gone to fault."""
        if self._machine.faults.take(f"reference-lost:{self.number}"):
            self.referenced = False
        if self.referencing and self.on_target:
            self.referencing, self.referenced = False, True
        if self.fault or not (self._injected() or self._follows_badly()):
            return False
        self.halt()
        self.servo, self.fault = False, True
        return True

    def _injected(self) -> bool:
        return str(self.number) in self._machine.faults.arguments("drive-fault")

    def _broken(self) -> bool:
        return self._injected() or self._leg.stalled

    def _follows_badly(self) -> bool:
        late = abs(self.place - self.target) > FOLLOWING_MM
        if not (self.servo and self._leg.stalled and late):
            self._late_since = None
            return False
        now = self._machine.clock.now()
        if self._late_since is None:
            self._late_since = now
        return now - self._late_since >= FOLLOWING_S

    def power_on(self) -> None:
        """Come up without power on the motor; the encoder is absolute and keeps its reference."""
        self.halt()
        self.servo = self.fault = False
        self.velocity = 20.0
