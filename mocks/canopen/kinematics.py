"""What a motion controller knows of its machine: how a pose becomes q with its own parameters."""

from collections.abc import Mapping, Sequence
from typing import Protocol

from mocks.canopen.hexapod_kinematics import HexapodKinematics
from mocks.canopen.ptm_kinematics import PtmKinematics


class Kinematics(Protocol):
    """One kind of machine. ``limbs`` names the limb that each actuator drives."""

    limbs: tuple[str, ...]

    def reference(self, n: int, active: Mapping[str, float]) -> float:
        """q of actuator ``n`` (from 0) at extension 0."""

    def targets(self, pose: Sequence[float], active: Mapping[str, float]) -> list[float]:
        """q of all actuators at ``pose`` with the parameters ``active``; raises Unreachable."""


def kinematics_of(machine: str) -> Kinematics:
    """The kinematics of a kind of machine; raises ValueError if no controller here knows it."""
    known: dict[str, type[Kinematics]] = {"hexapod": HexapodKinematics, "ptm": PtmKinematics}
    if machine not in known:
        raise ValueError(f"no mock controller on CANopen knows the machine {machine!r}")
    return known[machine]()
