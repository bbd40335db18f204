"""A CiA 402 servo drive that moves one leg.

Positions are extensions in counts of the unit that 0x60A8 states. Modes: 1 profile position
with the set-point handshake, 6 homing on the index pulse at extension 0, 8 cyclic synchronous
position, in which the motion controller gives the set-points. Bit 15 of the statusword, free for
the manufacturer, says that the drive knows its reference.
"""

import math
from pathlib import Path

from canopen.sdo.exceptions import SdoAbortedError

from mocks.canopen.node import ABORT_DEVICE_STATE, ABORT_RANGE, EMCY_HEARTBEAT, StationNode
from mocks.canopen.ports import Leg, Machine
from mocks.canopen.state402 import Command, State, next_state

PROFILE_POSITION, HOMING, CYCLIC_POSITION = 1, 6, 8
HOMING_METHODS = (33, 34)
EMCY_HARDWARE, EMCY_FOLLOWING = 0x5000, 0x8611
NEW_SETPOINT, IMMEDIATELY, RELATIVE, HALT = 1 << 4, 1 << 5, 1 << 6, 1 << 8
TARGET_REACHED, INTERNAL_LIMIT, MODE_BIT, ERROR_BIT, REFERENCED = (
    1 << 10, 1 << 11, 1 << 12, 1 << 13, 1 << 15,
)  # fmt: skip
# Quintic motion: largest speed and acceleration as multiples of way/time and way/time^2.
PEAK_SPEED, PEAK_ACCELERATION = 1.875, 5.7735


class Drive(StationNode):
    """Drive of leg ``number`` (from 1): node ``number`` on the bus."""

    def __init__(self, number: int, eds: Path, machine: Machine) -> None:
        super().__init__(number, eds)
        self.number = number
        self.machine = machine
        self.counts = machine.stroke.counts
        self.leg: Leg = machine.legs[number - 1]
        self.state = State.SWITCH_ON_DISABLED
        self.mode = 0
        self.fault_code = 0
        self.referenced = True
        self.limited = False
        self.mode_bit = False
        self._homing = False
        self._reached = True
        self._controlword = 0
        self._waiting: int | None = None
        self._following_since: float | None = None
        self._reported = -1
        self._install()

    def _install(self) -> None:
        self.readers |= {
            (0x603F, 0): lambda: self.fault_code,
            (0x6041, 0): self.statusword,
            (0x6061, 0): lambda: self.mode,
            (0x6062, 0): lambda: self.counts_at(self.leg.target),
            (0x6064, 0): lambda: self.counts_at(self.leg.position()),
        }
        self.writers |= {
            (0x6040, 0): self._on_controlword,
            (0x6060, 0): self._on_mode,
            (0x6098, 0): _check_homing_method,
        }

    def counts_at(self, extension: float) -> int:
        """What the drive counts at an extension (mm or rad)."""
        return round(extension * self.counts)

    def extension_at(self, counts: int) -> float:
        """Extension at which it counts so many."""
        return counts / self.counts

    def homing_target(self) -> int:
        """What it counts at its reference before it takes it."""
        return int(self.value(0x607C))

    # ------------------------------------------------------------ what the controller asks

    @property
    def follows(self) -> bool:
        """Whether it takes set-points from the motion controller."""
        return self.state is State.OPERATION_ENABLED and self.mode == CYCLIC_POSITION

    @property
    def faulted(self) -> bool:
        """Whether it is in fault."""
        return self.state is State.FAULT

    @property
    def settled(self) -> bool:
        """Whether the leg rests inside the position window of its target."""
        window = self.value(0x6067) / abs(self.counts)
        return not self.leg.moving and abs(self.leg.position() - self.leg.target) <= window

    def allows(self, extension: float) -> bool:
        """Whether an extension (mm or rad) is within the software limits 0x607D."""
        counts = self.counts_at(extension)
        return bool(self.value(0x607D, 1) <= counts <= self.value(0x607D, 2))

    def follow(self, extension: float, duration_s: float) -> None:
        """Cyclic position: be at ``extension`` in ``duration_s`` of machine time."""
        self.limited = False
        self.leg.command(extension, duration_s)

    # ------------------------------------------------------------ controlword

    def statusword(self) -> int:
        """Return 0x6041 as it is now."""
        word = self.state.bits | 1 << 4 | 1 << 9
        if self.mode in (0, PROFILE_POSITION, HOMING) and self._reached:
            word |= TARGET_REACHED
        if self.mode_bit or self.follows:
            word |= MODE_BIT
        if self.limited:
            word |= INTERNAL_LIMIT
        if self.fault_code == EMCY_FOLLOWING:
            word |= ERROR_BIT
        return word | REFERENCED if self.referenced else word

    def _on_controlword(self, word: int) -> None:
        before, self._controlword = self._controlword, word
        if word & 1 << 7 and not before & 1 << 7:
            self._reset_fault()
        self._go(next_state(self.state, Command.of(word)))
        rising = word & NEW_SETPOINT and not before & NEW_SETPOINT
        if self.state is State.OPERATION_ENABLED:
            if word & HALT and self.leg.moving:
                self.leg.stop()
            elif rising and self.mode == PROFILE_POSITION and not self.mode_bit:
                self._take_setpoint(word)
            elif rising and self.mode == HOMING:
                self._start_homing()
        if self.mode == PROFILE_POSITION and not word & NEW_SETPOINT and self._waiting is None:
            self.mode_bit = False
        self._report()

    def _go(self, state: State) -> None:
        if self.state is State.OPERATION_ENABLED and state is not State.OPERATION_ENABLED:
            self.leg.stop()
            self._homing, self._waiting, self.mode_bit = False, None, False
        self.state = state

    def _on_mode(self, mode: int) -> None:
        if mode not in (PROFILE_POSITION, HOMING, CYCLIC_POSITION):
            raise SdoAbortedError(ABORT_RANGE)
        if self.leg.moving:
            raise SdoAbortedError(ABORT_DEVICE_STATE)
        self.mode, self.mode_bit, self._homing, self._waiting = mode, False, False, None
        self._reached = True

    # ------------------------------------------------------------ profile position and homing

    def _take_setpoint(self, word: int) -> None:
        target = self.value(0x607A)
        if word & RELATIVE:
            target += self.counts_at(self.leg.target)
        self.mode_bit = True
        if self.leg.moving and not word & IMMEDIATELY:
            self._waiting = target
        else:
            self._start_profile(target)

    def _start_profile(self, target: int) -> None:
        low, high = self.value(0x607D, 1), self.value(0x607D, 2)
        clipped = min(max(target, low), high)
        self.limited = clipped != target
        self._reached = False
        self._move(clipped, self.value(0x6081), self.value(0x6083))

    def _start_homing(self) -> None:
        self._homing, self.mode_bit, self._reached = True, False, False
        self.referenced = False
        self._move(self.homing_target(), self.value(0x6099, 1), self.value(0x609A))

    def _move(self, target: int, speed: int, acceleration: int) -> None:
        way = abs(target - self.counts_at(self.leg.position()))
        slow = PEAK_SPEED * way / max(speed, 1)
        soft = math.sqrt(PEAK_ACCELERATION * way / max(acceleration, 1))
        self.leg.command(self.extension_at(target), max(slow, soft))

    # ------------------------------------------------------------ what happens by itself

    def tick(self) -> None:
        """Look at the leg and at what has gone wrong; called many times a second."""
        if self.machine.faults.take(f"reference-lost:{self.number}"):
            self.referenced = False
        if self.heartbeat_overdue() and self.state is not State.SWITCH_ON_DISABLED:
            self.lose_pc()
        if self._injected():
            self.fail(EMCY_HARDWARE)
        if self._follows_badly():
            self.fail(EMCY_FOLLOWING)
        if self.nmt.state == "STOPPED" and self.state is State.OPERATION_ENABLED:
            self._go(State.QUICK_STOP_ACTIVE)
        if not self.leg.moving:
            self._rest()
        self._report()

    def lose_pc(self) -> None:
        """The PC says nothing more."""
        self.fail(EMCY_HEARTBEAT)

    def attain(self) -> None:
        """Homing ends at the reference."""
        self._homing, self.mode_bit, self.referenced = False, True, True

    def _rest(self) -> None:
        if self.state is State.QUICK_STOP_ACTIVE and self.value(0x605A) in (1, 2, 3):
            self._go(State.SWITCH_ON_DISABLED)
        if self._waiting is not None:
            target, self._waiting = self._waiting, None
            self.mode_bit = bool(self._controlword & NEW_SETPOINT)
            self._start_profile(target)
        elif not self._reached and self.settled:
            self._reached = True
            if self._homing:
                self.attain()

    def _injected(self) -> bool:
        return str(self.number) in self.machine.faults.arguments("drive-fault")

    def _follows_badly(self) -> bool:
        error = abs((self.leg.target - self.leg.position()) * self.counts)
        powered = self.state is State.OPERATION_ENABLED
        if not (powered and self.leg.stalled and error > self.value(0x6065)):
            self._following_since = None
            return False
        now = self.machine.clock.now()
        if self._following_since is None:
            self._following_since = now
        return bool(now - self._following_since >= self.value(0x6066) / 1000.0)

    def fail(self, code: int) -> None:
        """Go to fault with ``code``: brake, power off, tell with EMCY."""
        if self.faulted:
            return
        self.leg.stop()
        self._homing, self._waiting, self.mode_bit = False, None, False
        self.state, self.fault_code = State.FAULT, code
        self.emergency(code, 0x21 if code == EMCY_FOLLOWING else 0x11)
        self._report()

    def _reset_fault(self) -> None:
        if not self.faulted or self._injected() or self.leg.stalled:
            return
        self.state, self.fault_code = State.SWITCH_ON_DISABLED, 0
        self._reached = True
        self.emergency(0, 0)

    def reset(self, application: bool) -> None:
        """NMT reset; of the application: power off, as after switching on."""
        if application:
            self.power_on()
        else:
            self.boot()

    def power_on(self) -> None:
        """Come up without power on the motor; the encoder is absolute and keeps its reference."""
        self.leg.stop()
        self.state, self.mode, self.fault_code = State.SWITCH_ON_DISABLED, 0, 0
        self._homing, self._waiting, self.mode_bit, self._reached = False, None, False, True
        self._controlword, self._reported, self.limited = 0, -1, False
        self.boot()

    def _report(self) -> None:
        word = self.statusword()
        if word != self._reported:
            self._reported = word
            self.send_tpdo(1)


def _check_homing_method(method: int) -> None:
    if method not in HOMING_METHODS:
        raise SdoAbortedError(ABORT_RANGE)
