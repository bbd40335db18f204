"""The controller's motion status object 0x2410, as its TPDO 1 brings it."""

import struct
from dataclasses import dataclass

from drivers.errors import Refused

ENABLED, MOVING, ARRIVED, FAULTED, REFERENCED, UNSTORED, INTERRUPTED = (
    1 << 0, 1 << 1, 1 << 2, 1 << 3, 1 << 4, 1 << 5, 1 << 6,
)  # fmt: skip

RESULTS = {
    1: ("motion is not enabled", "Enable the machine first."),
    2: ("a drive is in fault", "Remove the cause, clear the faults and enable the machine again."),
    3: ("the commanded pose is incomplete or not finite", "Command the whole pose again."),
    4: (
        "a target is outside the controller's limits",
        "Choose a pose within the actuators' travel; check the parameters if it should be.",
    ),
    5: (
        "the controller finds no actuator positions for this pose",
        "Choose a pose inside the workspace; check the controller's parameters.",
    ),
    6: ("the controller does not know this command", "Check that its EDS file is the right one."),
    7: ("an actuator does not know its reference", "Home the actuators named."),
}


@dataclass(frozen=True)
class MotionStatus:
    """One status: which command it answers, what became of it, and what the machine does now.

    ``bits`` are those at the head of this file; ``concerned`` has bit n - 1 set for actuator n.
    """

    sequence: int
    bits: int
    result: int
    concerned: int

    @classmethod
    def from_bytes(cls, data: bytes) -> "MotionStatus":
        """Read the eight bytes of the TPDO."""
        return cls(*struct.unpack("<4H", data))

    def answers(self, sequence: int) -> bool:
        """Whether this is the answer to command ``sequence`` or to a later one."""
        return (self.sequence - sequence) % 0x10000 < 0x8000

    @property
    def enabled(self) -> bool:
        """Whether every drive takes set-points."""
        return bool(self.bits & ENABLED)

    @property
    def moving(self) -> bool:
        """Whether any actuator is under way."""
        return bool(self.bits & MOVING)

    @property
    def arrived(self) -> bool:
        """Whether the commanded motion ended at its target."""
        return bool(self.bits & ARRIVED)

    def refusal(self, device: str, actuators: tuple[str, ...]) -> Refused | None:
        """Return the exception for a refused command, None for an accepted one."""
        if self.result == 0:
            return None
        what, remedy = RESULTS.get(self.result, (f"refused with result {self.result}", ""))
        names = [q for n, q in enumerate(actuators) if self.concerned >> n & 1]
        if names:
            what = f"{what} ({', '.join(names)})"
        return Refused(what, device=device, remedy=remedy, code=self.result)
