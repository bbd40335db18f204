"""How a command reaches a machine that knows no kinematics of ours, and what comes back.

A command is a vector of extensions, whatever the machine takes. What it is told is recorded as
actuator coordinates q = extension + reference with the *drawn* reference: zero of a drive, or of a
closed controller's own geometry, does not move when the host learns better parameters.
"""

from dataclasses import replace
from typing import Protocol

import numpy as np

from calib.arrays import Array
from calib.mechanism.description import Machine
from calib.mechanism.rigid import Poses, pose_difference
from calib.mechanism.solve import Configuration, forward, inverse
from drivers.errors import ProtocolError, Refused
from drivers.interface import ActuatorState, ControllerState, Motors, Moving, PoseMover

MISHEARD_MM, MISHEARD_RAD = 0.01, 1e-4
"""A pose that reads back farther from what was commanded was misunderstood, not rounded."""


class Means(Protocol):
    """What moves the machine."""

    @property
    def device(self) -> Moving:
        """The device."""

    async def send(self, extension: Array) -> tuple[float, ...]:
        """Start moving to an extension (n,), mm or rad; returns q as the device took it."""

    async def state(self) -> ControllerState:
        """Snapshot with one entry for each actuator of the machine."""

    async def home(self, actuator: str) -> None:
        """Find the reference of an actuator of the machine."""

    async def frame(self) -> dict[str, str]:
        """What poses refer to, in the device's own words."""


class ByMotors:
    """Drives that take actuator values: q goes as it is."""

    def __init__(self, motors: Motors, machine: Machine) -> None:
        self.device = motors
        self._machine = machine

    async def send(self, extension: Array) -> tuple[float, ...]:
        """Start moving all drives together."""
        q = tuple(float(v) for v in self._machine.coordinates(extension[:, None])[:, 0])
        await self.device.move_actuators(q)
        return q

    async def state(self) -> ControllerState:
        """Snapshot of the drives."""
        return await self.device.state()

    async def home(self, actuator: str) -> None:
        """Run one drive's homing."""
        await self.device.home(actuator)

    async def frame(self) -> dict[str, str]:
        """Nothing: it knows no poses."""
        return {}


class ByPoses:
    """A closed controller that takes poses: it is told the pose of the drawn machine."""

    def __init__(self, mover: PoseMover, machine: Machine) -> None:
        self.device = mover
        self._machine = machine
        self._near: Configuration | None = None
        self._told: tuple[tuple[float, ...], tuple[float, ...]] = ((), ())
        """Pose that the controller is bound for, and its coordinates."""

    async def send(self, extension: Array) -> tuple[float, ...]:
        """Start moving to the pose that the drawn machine has at these extensions.

        Raises
        ------
        ProtocolError
            If the controller understood another pose.
        """
        drawn = forward(self._machine, extension[:, None])
        pose = tuple(float(v) for v in drawn.poses.to_xyz_rpy()[:, 0])
        await self.device.move_pose(pose)
        told = await self.device.commanded_pose()
        off = pose_difference(drawn.poses, Poses.from_xyz_rpy(np.array(told)[:, None]))[:, 0]
        if np.linalg.norm(off[:3]) > MISHEARD_MM or np.linalg.norm(off[3:]) > MISHEARD_RAD:
            await self.device.stop()
            raise ProtocolError(
                f"was told {_said(pose)} and says that it goes to {_said(told)}",
                device=self.device.identity.kind,
                remedy="Check units, rotation order and coordinate system in the site file",
            )
        self._told = (told, self._coordinates([told])[0])
        return self._told[1]

    async def state(self) -> ControllerState:
        """The actuators as it tells them, or as the drawn machine has them at its poses.

        Poses at which the drawn machine does not close (before referencing) show as nan.
        """
        said = await self.device.state()
        axes = said.actuators
        if [axis.name for axis in axes] == [one.name for one in self._machine.actuators]:
            return said
        at, to = self._at_and_to(
            tuple(axis.position for axis in axes), tuple(axis.target for axis in axes)
        )
        fault = next((axis.fault for axis in axes if axis.fault), "")
        shared = ActuatorState(
            "", 0.0, 0.0, axes[0].state, any(axis.moving for axis in axes),
            all(axis.homed for axis in axes), fault,
        )  # fmt: skip
        actuators = tuple(
            replace(shared, name=actuator.name, position=at[k], target=to[k])
            for k, actuator in enumerate(self._machine.actuators)
        )
        return replace(said, actuators=actuators)

    async def home(self, actuator: str) -> None:
        """Find the reference of every pose axis that has none: they may have one together."""
        if actuator not in [one.name for one in self._machine.actuators]:
            raise Refused(
                f"there is no actuator {actuator}",
                device=self.device.identity.kind,
                remedy=f"Name one of {', '.join(one.name for one in self._machine.actuators)}",
            )
        for name in [axis.name for axis in (await self.device.state()).actuators]:
            found = {axis.name: axis.homed for axis in (await self.device.state()).actuators}
            if not found[name]:
                await self.device.home(name)

    async def frame(self) -> dict[str, str]:
        """Pivot, coordinate system and rotation order, as it says them."""
        return await self.device.frame()

    def _at_and_to(
        self, at: tuple[float, ...], to: tuple[float, ...]
    ) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """Coordinates where it is, and where it is bound for: that changes with every command."""
        if to == self._told[0]:
            return self._coordinates([at])[0], self._told[1]
        here, there = self._coordinates([at, to])
        self._told = (to, there)
        return here, there

    def _coordinates(self, poses: list[tuple[float, ...]]) -> list[tuple[float, ...]]:
        """Actuator coordinates (n,) of the drawn machine at poses; nan where it does not close."""
        wanted = Poses.from_xyz_rpy(np.array(poses).T)
        closed = inverse(self._machine, wanted, start=self._near)
        if self._near is not None and not closed.converged.all():
            closed = inverse(self._machine, wanted)
        if closed.converged[0]:
            self._near = closed.take(slice(0, 1))
        q = np.where(closed.converged, self._machine.coordinates(closed.extension), np.nan)
        return [tuple(map(float, column)) for column in q.T]


def _said(pose: tuple[float, ...]) -> str:
    return "(" + ", ".join(f"{value:.5g}" for value in pose) + ")"
