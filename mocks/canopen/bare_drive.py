"""A CiA 402 drive as its maker sells it: it knows no controller, and takes its time.

It counts increments of its encoder, from where it was switched on until it has found its
reference; some count backwards. It does what real drives do beside the standard's state machine:

* 0x6061 follows 0x6060 after :data:`LATE_MODE_S`, a fault is reset after :data:`LATE_RESET_S`;
* bits 10 and 12 of an earlier homing stand for :data:`STALE_S` after a new one has begun;
* RPDOs are mapped as the PC writes it; one that is too short is dropped, with EMCY 0x8210;
* without the PC's heartbeat it does what 0x6007 says;
* in mode 8 it goes to 0x607A at each SYNC, within the period of 0x60C2; without SYNC it stands
  where the last one sent it, and says so only if 0x1006 tells it when to expect one.

These times are wall time, as those of heartbeats are.
"""

import math
import time
from pathlib import Path
from typing import Any

import canopen
from canopen.sdo.exceptions import SdoAbortedError

from mocks.canopen.bare_eds import gearing_of
from mocks.canopen.drive402 import (
    CYCLIC_POSITION,
    EMCY_FOLLOWING,
    HOMING,
    HOMING_METHODS,
    MODE_BIT,
    NEW_SETPOINT,
    PROFILE_POSITION,
    REFERENCED,
    TARGET_REACHED,
    Drive,
)
from mocks.canopen.node import ABORT_DEVICE_STATE, ABORT_RANGE, OPERATIONAL
from mocks.canopen.ports import Machine
from mocks.canopen.state402 import State

LATE_MODE_S, LATE_RESET_S, STALE_S = 0.03, 0.02, 0.03
EMCY_PDO_LENGTH, EMCY_SYNC = 0x8210, 0x8700
NOTHING, MALFUNCTION, DISABLE_VOLTAGE, QUICK_STOP = 0, 1, 2, 3
QUICK_STOP_CODES = (0, 1, 2, 3, 5, 6, 7)
STAYS_IN_QUICK_STOP = (5, 6, 7)
RPDOS = range(1, 5)
INVALID, LAST_SYNCHRONOUS = 1 << 31, 240
ABORT_ACCESS = 0x0601_0000
BACKWARDS = (2, 5)
"""Drives whose motor is mounted so that they count down as the actuator goes up."""
IMPOSSIBLE = 20.0
"""A set-point that asks for so many times the profile's speed is not followed."""


class BareDrive(Drive):
    """Drive of leg ``number``, without a controller above it."""

    def __init__(self, number: int, eds: Path, machine: Machine) -> None:
        self._zero = 0.0
        self._late_mode: tuple[float, int] | None = None
        self._late_reset: float | None = None
        self._stale_until = -math.inf
        self._attained = False
        self._waiting_for_sync: dict[int, bytes] = {}
        super().__init__(number, eds, machine)
        self.counts = gearing_of(machine.unit).counts * (-1 if number in BACKWARDS else 1)
        self.referenced = False

    def _install(self) -> None:
        super()._install()
        self.readers[0x2010, 0] = lambda: int(self.referenced)
        self.writers |= {
            (0x605A, 0): lambda code: _must(code in QUICK_STOP_CODES, ABORT_RANGE),
            (0x6007, 0): lambda code: _must(0 <= code <= QUICK_STOP, ABORT_RANGE),
            (0x6098, 0): lambda method: _must(method in HOMING_METHODS, ABORT_RANGE),
        }
        for number in RPDOS:
            for sub in range(1, 5):
                self.writers[0x1600 + number - 1, sub] = self._mapping_may_change(number)

    def _mapping_may_change(self, number: int) -> Any:
        def check(_: int) -> None:
            off = self.value(0x1400 + number - 1, 1) & INVALID
            _must(bool(off) and self.value(0x1600 + number - 1, 0) == 0, ABORT_ACCESS)

        return check

    # ------------------------------------------------------------ counting

    def counts_at(self, extension: float) -> int:
        """Increments since it was switched on, or from its reference."""
        return round((extension - self._zero) * self.counts)

    def extension_at(self, counts: int) -> float:
        """Extension at which it counts so many."""
        return counts / self.counts + self._zero

    def homing_target(self) -> int:
        """Where the index pulse is, as it counts before it has found it."""
        return self.counts_at(0.0)

    def attain(self) -> None:
        """Count from the reference on."""
        super().attain()
        self._zero = -self.value(0x607C) / self.counts
        self._attained = True

    def power_on(self) -> None:
        """Come up without a reference."""
        super().power_on()
        self._zero, self.referenced, self._attained = self.leg.position(), False, False
        self._late_mode = self._late_reset = None
        self._waiting_for_sync.clear()

    # ------------------------------------------------------------ what comes late

    def statusword(self) -> int:
        """Return 0x6041; bit 14 is this maker's word for the reference."""
        word = super().statusword() & ~REFERENCED
        if self.mode == HOMING and self._attained:
            at_rest = not self._homing and self.state is State.OPERATION_ENABLED
            if at_rest or time.monotonic() < self._stale_until:
                word |= TARGET_REACHED | MODE_BIT
        if self.state is State.QUICK_STOP_ACTIVE and not self.leg.moving:
            word |= TARGET_REACHED
        return word | 1 << 14 if self.referenced else word

    def _start_homing(self) -> None:
        self._stale_until = time.monotonic() + STALE_S if self._attained else -math.inf
        super()._start_homing()

    def _on_mode(self, mode: int) -> None:
        _must(mode in (PROFILE_POSITION, HOMING, CYCLIC_POSITION), ABORT_RANGE)
        if mode == (self._late_mode[1] if self._late_mode else self.mode):
            return
        _must(not self.leg.moving, ABORT_DEVICE_STATE)
        self._late_mode = (time.monotonic() + LATE_MODE_S, mode)

    def _reset_fault(self) -> None:
        if self.faulted and self._late_reset is None:
            self._late_reset = time.monotonic() + LATE_RESET_S

    def tick(self) -> None:
        """As any drive; and what is late comes when it is due."""
        now = time.monotonic()
        if self._late_mode is not None and now >= self._late_mode[0]:
            mode, self._late_mode = self._late_mode[1], None
            super()._on_mode(mode)
        if self._late_reset is not None and now >= self._late_reset:
            self._late_reset = None
            super()._reset_fault()
        if self.machine.faults.take(f"leaves-mode:{self.number}"):
            self.leg.stop()
            self.mode = PROFILE_POSITION
        if self.follows and self._misses_sync() and self.value(0x1006):
            self.fail(EMCY_SYNC)
        super().tick()

    def _misses_sync(self) -> bool:
        return f"sync-lost:{self.number}" in self.machine.faults

    def lose_pc(self) -> None:
        """What 0x6007 says of a connection that is gone."""
        match self.value(0x6007):
            case code if code == MALFUNCTION:
                super().lose_pc()
            case code if code == DISABLE_VOLTAGE:
                self._go(State.SWITCH_ON_DISABLED)
            case code if code == QUICK_STOP and self.state is State.OPERATION_ENABLED:
                self._go(State.QUICK_STOP_ACTIVE)

    def _move(self, target: int, speed: int, acceleration: int) -> None:
        if f"runs-away:{self.number}" in self.machine.faults:
            target = 2 * self.counts_at(self.leg.position()) - target
        super()._move(target, speed, acceleration)

    # ------------------------------------------------------------ PDOs as they are mapped now

    def listen_to_pdos(self) -> None:
        """Listen where RPDOs can be, and to SYNC."""
        network: canopen.Network = self.network
        for number in RPDOS:
            network.subscribe(0x100 + 0x100 * number + self.number, self._on_frame)
        network.subscribe(0x80, self._on_sync)

    def _on_frame(self, cob_id: int, data: bytearray, _timestamp: float) -> None:
        if self.nmt.state != OPERATIONAL:
            return
        for number in RPDOS:
            if self.value(0x1400 + number - 1, 1) == cob_id:
                if len(data) < sum(size for _, _, size in self._mapped(number)):
                    self.emergency(EMCY_PDO_LENGTH, 0x11)
                elif self.value(0x1400 + number - 1, 2) <= LAST_SYNCHRONOUS:
                    self._waiting_for_sync[number] = bytes(data)
                else:
                    self._apply(number, bytes(data))

    def _mapped(self, number: int) -> list[tuple[int, int, int]]:
        index = 0x1600 + number - 1
        words = [self.value(index, sub + 1) for sub in range(self.value(index, 0))]
        return [(word >> 16, word >> 8 & 0xFF, (word & 0xFF) // 8) for word in words]

    def _apply(self, number: int, data: bytes) -> None:
        """Take all values of a PDO; the controlword acts when the others are there."""
        values, offset = [], 0
        for index, sub, size in self._mapped(number):
            values.append((index, sub, data[offset : offset + size]))
            offset += size
        for index, sub, value in sorted(values, key=lambda one: one[0] == 0x6040):
            try:
                self.set_data(index, sub, value)
            except SdoAbortedError:
                continue  # a PDO has nobody to answer

    def _on_sync(self, _cob_id: int, _data: bytearray, _timestamp: float) -> None:
        if self.nmt.state != OPERATIONAL or self._misses_sync():
            return
        for number, data in sorted(self._waiting_for_sync.items()):
            self._apply(number, data)
        self._waiting_for_sync.clear()
        if self.state is State.OPERATION_ENABLED and self.mode == CYCLIC_POSITION:
            self._follow_setpoint()

    def _follow_setpoint(self) -> None:
        period = self.value(0x60C2, 1) * 10.0 ** self.value(0x60C2, 2) * self.machine.clock.scale
        low, high = self.value(0x607D, 1), self.value(0x607D, 2)
        target = min(max(self.value(0x607A), low), high)
        way = abs(target - self.counts_at(self.leg.position()))
        if way > IMPOSSIBLE * self.value(0x6081) * period:
            self.fail(EMCY_FOLLOWING)
        elif way:
            self.leg.command(self.extension_at(target), period)

    def _on_controlword(self, word: int) -> None:
        if self.state is State.QUICK_STOP_ACTIVE and not self._may_leave_quick_stop():
            word &= ~(1 << 3 | NEW_SETPOINT)
        super()._on_controlword(word)

    def _may_leave_quick_stop(self) -> bool:
        """Operation comes back from a quick stop only where 0x605A lets the drive stay there."""
        return self.value(0x605A) in STAYS_IN_QUICK_STOP


def _must(good: bool, otherwise: int) -> None:
    if not good:
        raise SdoAbortedError(otherwise)
