"""The motion controller: holds the parameters, and moves the drives with them.

A commanded pose becomes leg lengths with the active parameters, q_i = L0_i + s_i; the drives make
s_i corrected for pitch, cyclic error and lost motion. So what is written to the parameters is what
the machine does next.
"""

import math
from collections import Counter
from collections.abc import Sequence
from enum import IntEnum
from functools import partial
from pathlib import Path

from canopen.sdo.exceptions import SdoAbortedError

from mocks.canopen.compensation import Compensation, direction_of
from mocks.canopen.drive402 import PEAK_SPEED, Drive
from mocks.canopen.kinematics import kinematics_of
from mocks.canopen.node import (
    ABORT_RANGE,
    EMCY_HEARTBEAT,
    StationNode,
)
from mocks.canopen.parameter_server import ParameterServer
from mocks.canopen.parameters import ParameterSet
from mocks.canopen.ports import Machine
from mocks.canopen.state402 import State
from mocks.canopen.unreachable import Unreachable

SHORTEST_MOVE_S = 0.01
EMCY_MEMORY = 0x5530
# Counts: a single drive takes its set-point in whole ones.
SETPOINT_TOLERANCE = 2.0
ENABLED, MOVING, ARRIVED, FAULTED, ALL_REFERENCED, UNSTORED, INTERRUPTED = (
    1 << 0, 1 << 1, 1 << 2, 1 << 3, 1 << 4, 1 << 5, 1 << 6,
)  # fmt: skip


class Command(IntEnum):
    """What 0x2401:2 may hold."""

    NONE = 0
    MOVE_TO_POSE = 1
    MOVE_TO_Q = 2
    STOP = 3
    # PREPARE + n turns the commanded q of actuator n (from 1) into its drive's set-point 0x2403.
    PREPARE = 0x10


class Result(IntEnum):
    """What became of the last command, in 0x2410:3."""

    ACCEPTED = 0
    NOT_ENABLED = 1
    DRIVE_FAULT = 2
    INCOMPLETE = 3
    OUTSIDE_LIMITS = 4
    UNREACHABLE = 5
    UNKNOWN_COMMAND = 6
    NOT_REFERENCED = 7


class Controller(StationNode):
    """Node that moves ``drives`` together."""

    def __init__(
        self,
        node_id: int,
        eds: Path,
        machine: Machine,
        drives: Sequence[Drive],
        nvm_path: Path | None,
    ) -> None:
        super().__init__(node_id, eds)
        self.machine = machine
        self.drives = drives
        self.parameters = ParameterSet(self.object_dictionary, nvm_path)
        self._server = ParameterServer(self, self.parameters, machine.faults)
        count = len(drives)
        self._kinematics = kinematics_of(machine.kind)
        self._axes = range(1, count + 1)
        self._coordinates = range(1, len(self.object_dictionary[0x2400]))
        self._tolerance = SETPOINT_TOLERANCE / machine.stroke.counts
        self._direction = [0] * count
        self._wanted = [0.0] * count
        self._setpoints = [0.0] * count
        self._targets = [self._reference(n) for n in range(count)]
        self._received: set[int] = set()
        self._ends_at = -math.inf
        self._under_way = self._interrupted = self._arrived = False
        self._pc_lost = False
        self._concerned, self._result = 0, Result.ACCEPTED
        self._reported = -1
        self.moved_with: Counter[int] = Counter()
        """How many motions were begun with a set of parameters, by its CRC-32: for judges."""
        self._install()

    def _install(self) -> None:
        self.readers |= {
            (0x2300, 1): self.machine.structure_temp_C,
            (0x2300, 2): lambda: self.machine.payload_kg,
            (0x2410, 1): lambda: self.value(0x2401, 1),
            (0x2410, 2): self.status_bits,
            (0x2410, 3): lambda: int(self._result),
            (0x2410, 4): lambda: self._concerned,
        }
        for axis in self._axes:
            self.readers[0x2411, axis] = partial(self._target, axis - 1)
            self.readers[0x2412, axis] = partial(self._actual, axis - 1)
            self.writers[0x2402, axis] = _check_finite
        for coordinate in self._coordinates:
            self.writers[0x2400, coordinate] = partial(self._on_pose, coordinate)
        self.writers |= {
            (0x2401, 2): self._on_command,
            (0x2430, 0): _check_speed,
        }

    # ------------------------------------------------------------ state

    @property
    def any_drive_enabled(self) -> bool:
        """Whether a motor has power: nothing may be changed under it."""
        return any(drive.state is State.OPERATION_ENABLED for drive in self.drives)

    @property
    def enabled(self) -> bool:
        """Whether every drive takes set-points."""
        return all(drive.follows for drive in self.drives)

    def status_bits(self) -> int:
        """Return the bits of 0x2410:2."""
        bits = ENABLED if self.enabled else 0
        bits |= MOVING if any(drive.leg.moving for drive in self.drives) else 0
        bits |= ARRIVED if self._arrived else 0
        bits |= FAULTED if any(drive.faulted for drive in self.drives) else 0
        bits |= ALL_REFERENCED if all(drive.referenced for drive in self.drives) else 0
        bits |= UNSTORED if self.parameters.active != self.parameters.kept else 0
        return bits | (INTERRUPTED if self._interrupted else 0)

    def _reference(self, n: int) -> float:
        """q of actuator ``n`` at extension 0."""
        return self._kinematics.reference(n, self.parameters.active)

    def _compensation(self, n: int) -> Compensation:
        active, leg = self.parameters.active, self._kinematics.limbs[n]
        table = f"screw-cyclic-table.{leg}"
        points = sum(name.startswith(f"{table}.") for name in active) - 1
        return Compensation(
            active[f"screw-pitch.{leg}"],
            active[f"backlash.{leg}"],
            active[f"{table}.period"],
            [active[f"{table}.{k}"] for k in range(points)] if active[f"{table}.period"] else (),
        )

    def _target(self, n: int) -> float:
        """Where actuator ``n`` is bound for: as commanded, unless it was stopped or homed since."""
        rest = self.drives[n].leg.target
        if abs(rest - self._setpoints[n]) <= self._tolerance:
            return self._targets[n]
        return self._reference(n) + self._compensation(n).wanted_for(rest, self._direction[n])

    def _actual(self, n: int) -> float:
        drive = self.drives[n].leg.position()
        return self._reference(n) + self._compensation(n).wanted_for(drive, self._direction[n])

    # ------------------------------------------------------------ commands

    def _on_pose(self, axis: int, value: float) -> None:
        self._received.discard(axis)
        _check_finite(value)
        self._received.add(axis)

    def _on_command(self, code: int) -> None:
        self._concerned = 0
        self._result = self._carry_out(code)
        self._reported = -1
        if code == Command.MOVE_TO_POSE and self._result is Result.ACCEPTED:
            for axis in self._axes:
                self.send_tpdo(axis + 1)
        self.report()

    def _carry_out(self, code: int) -> Result:
        if code == Command.STOP:
            self.halt()
            return Result.ACCEPTED
        if code == Command.MOVE_TO_POSE:
            complete = len(self._received) == len(self._coordinates)
            self._received.clear()
            if not complete:
                return Result.INCOMPLETE
            try:
                return self._start(self._solve())
            except Unreachable as error:
                self._concerned = 1 << error.leg
                return Result.UNREACHABLE
        if code == Command.MOVE_TO_Q:
            return self._start([self.value(0x2402, axis) for axis in self._axes])
        if code - Command.PREPARE in self._axes:
            return self._prepare(code - Command.PREPARE)
        return Result.UNKNOWN_COMMAND

    def _solve(self) -> list[float]:
        pose = [self.value(0x2400, axis) for axis in self._coordinates]
        return self._kinematics.targets(pose, self.parameters.active)

    def _outside(self, targets: Sequence[float]) -> int:
        """Bits of the actuators whose target is outside the controller's or its drive's limits."""
        return sum(
            1 << n
            for n, q in enumerate(targets)
            if not self.value(0x2420, n + 1) <= q <= self.value(0x2421, n + 1)
            or not self.drives[n].allows(q - self._reference(n))
        )

    def _start(self, targets: list[float]) -> Result:
        if any(drive.faulted for drive in self.drives):
            self._concerned = sum(1 << n for n, d in enumerate(self.drives) if d.faulted)
            return Result.DRIVE_FAULT
        if not self.enabled:
            self._concerned = sum(1 << n for n, d in enumerate(self.drives) if not d.follows)
            return Result.NOT_ENABLED
        self._concerned = sum(1 << n for n, d in enumerate(self.drives) if not d.referenced)
        if self._concerned:
            return Result.NOT_REFERENCED
        self._concerned = self._outside(targets)
        if self._concerned:
            return Result.OUTSIDE_LIMITS
        self._move(targets)
        return Result.ACCEPTED

    def _move(self, targets: list[float]) -> None:
        self.moved_with[self.parameters.checksum()] += 1
        setpoints = [self._setpoint(n, q) for n, q in enumerate(targets)]
        self._targets = targets
        way = max(
            abs(s - d.leg.position()) for s, d in zip(setpoints, self.drives, strict=True)
        )  # fmt: skip
        duration = max(SHORTEST_MOVE_S, PEAK_SPEED * way / self.value(0x2430))
        for drive, setpoint in zip(self.drives, setpoints, strict=True):
            drive.follow(setpoint, duration)
        self._ends_at = self.machine.clock.now() + duration
        self._under_way, self._interrupted, self._arrived = True, False, False

    def _setpoint(self, n: int, q: float) -> float:
        """Extension that drive ``n`` must make for ``q``, in the direction of this change."""
        self._notice_other_motion(n)
        wanted = q - self._reference(n)
        self._turn(n, wanted)
        self._setpoints[n] = self._compensation(n).drive_for(wanted, self._direction[n])
        return self._setpoints[n]

    def _notice_other_motion(self, n: int) -> None:
        """Take note of where homing, a stop or a fault has left the drive since."""
        rest = self.drives[n].leg.target
        if abs(rest - self._setpoints[n]) > self._tolerance:
            self._turn(n, self._compensation(n).wanted_for(rest, self._direction[n]))

    def _turn(self, n: int, wanted: float) -> None:
        change, smallest = wanted - self._wanted[n], self.machine.stroke.smallest
        self._direction[n] = direction_of(change, self._direction[n], smallest)
        self._wanted[n] = wanted

    def _prepare(self, axis: int) -> Result:
        """Turn one commanded q into the set-point of its drive (jogging), in counts."""
        n, q = axis - 1, self.value(0x2402, axis)
        targets = list(self._targets)
        targets[n] = q
        self._concerned = self._outside(targets) & 1 << n
        if self._concerned:
            return Result.OUTSIDE_LIMITS
        self.keep(0x2403, axis, round(self._setpoint(n, q) * self.machine.stroke.counts))
        self._targets = targets
        return Result.ACCEPTED

    def halt(self) -> None:
        """Stop every leg now."""
        for drive in self.drives:
            drive.leg.stop()
        if self._under_way:
            self._under_way, self._interrupted = False, True

    # ------------------------------------------------------------ what happens by itself

    @property
    def wall_time_left(self) -> float:
        """Wall seconds until the motion should be over; infinite at rest."""
        if not self._under_way:
            return math.inf
        left = self._ends_at - self.machine.clock.now()
        return max(left, 0.0) / self.machine.clock.scale

    def tick(self) -> None:
        """Watch the motion and the PC; called many times a second, after the drives."""
        if self.heartbeat_overdue():
            self.halt()
            self._pc_lost = True
            self.emergency(EMCY_HEARTBEAT, 0x11)
        elif self._pc_lost and self.hears_pc:
            self._pc_lost = False
            self.emergency(0, 0)
        if self._under_way and not self.enabled:
            self.halt()
        if self._under_way and all(drive.settled for drive in self.drives):
            self._under_way, self._arrived = False, True
        self.report()

    def report(self) -> None:
        """Send the status if it has changed."""
        bits = self.status_bits()
        if bits != self._reported:
            self._reported = bits
            self.send_tpdo(1)

    def reset(self, application: bool) -> None:
        """NMT reset; of the application: as after switching on."""
        if application:
            self.power_on()
        else:
            self.boot()

    def power_on(self) -> None:
        """Come up with the stored parameters."""
        intact = self.parameters.boot()
        count = len(self.drives)
        self._direction = [0] * count
        self._setpoints = [drive.leg.target for drive in self.drives]
        self._wanted = list(self._setpoints)
        self._targets = [self._reference(n) + self._wanted[n] for n in range(count)]
        self._received.clear()
        self._under_way = self._interrupted = self._arrived = self._pc_lost = False
        self._concerned, self._result, self._reported = 0, Result.ACCEPTED, -1
        self.boot()
        if not intact:
            self.emergency(EMCY_MEMORY, 0x81)


def _check_finite(value: float) -> None:
    if not math.isfinite(value):
        raise SdoAbortedError(ABORT_RANGE)


def _check_speed(value: float) -> None:
    if not 0.0 < value <= 200.0:
        raise SdoAbortedError(ABORT_RANGE)
