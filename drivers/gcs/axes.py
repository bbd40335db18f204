"""How a controller calls its axes, and what status register 1 says of one."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from drivers.gcs.conventions import Convention

# Bits of status register 1.
ERROR, SERVO, MOVING, REFERENCING, ON_TARGET = 1 << 8, 1 << 12, 1 << 13, 1 << 14, 1 << 15


@dataclass(frozen=True)
class Axes:
    """Actuator name -> axis of the controller, and the axes of the platform's pose.

    ``turns``: how angles are written, where the pose axes are six; else they are its position.
    """

    actuators: Mapping[str, str]
    pose: Sequence[str]
    turns: Convention | None = None

    @property
    def driven(self) -> list[str]:
        """Axes of the actuators, in their order."""
        return list(self.actuators.values())

    @property
    def words(self) -> str:
        """The same, as a command names them."""
        return " ".join(self.driven)


TRIPOD = Axes({"q1": "A", "q2": "B", "q3": "C"}, "XYZ")


def state_name(word: int) -> str:
    """Return a status register in words."""
    if word & ERROR:
        return "fault"
    return "servo on" if word & SERVO else "servo off"
