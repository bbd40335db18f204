"""A motion controller whose parameters and mathematics are the host's."""

import asyncio
import time
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from app.errors import GateRefused
from app.hosted.command import Commander
from app.hosted.means import Means
from app.hosted.parameters import DEVICE, ParameterSet
from app.hosted.store import HostStore
from calib.arrays import Array
from calib.mechanism.description import Machine
from calib.runs.header import Load
from drivers.errors import ParameterError, Refused
from drivers.interface import ActuatorState, Alarm, ControllerCan, ControllerState, StopsAtOnce
from drivers.operator.motors import Ask, PersonMoves
from drivers.playing import PlaysRows

SHORT_OF_TARGET = 0.02
"""An actuator that rests farther from its target, mm or rad, did not come to it."""


class HostedController:
    """Takes poses and parameters as any :class:`drivers.interface.MotionController` does.

    Parameters
    ----------
    machine : Machine
    means : Means
        What moves the machine; closed with this.
    store : HostStore
        Open; closed with this.
    load : Load, optional
        What the machine carries; without one there is no weight.
    clock : callable, optional
        Machine seconds, for effects that remember.
    """

    def __init__(
        self,
        machine: Machine,
        means: Means,
        store: HostStore,
        load: Load | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.machine = machine
        self._means = means
        self._store = store
        self.identity = means.device.identity
        can = means.device.can
        self.can = ControllerCan(parameters=True, homes=can.homes, channels=can.channels)
        self._hooks: list[Callable[[Alarm], None]] = []
        self._said: tuple[str, ...] = ()
        drawn = ParameterSet.nominal(machine)
        self._commander = Commander(machine, drawn, load, clock)
        self._broken: ParameterError | None = None
        self._load()

    def _load(self) -> None:
        """Take the stored set; one that cannot be used blocks motion, not the way back."""
        try:
            _, chosen = self._store.load()
        except ParameterError as error:
            self._broken = error
        else:
            self._use(chosen)

    def _use(self, chosen: ParameterSet) -> None:
        self._commander = self._commander.with_set(chosen)
        self._broken = None

    @property
    def chosen(self) -> ParameterSet:
        """The set in use; raises :class:`ParameterError` while the store cannot be used."""
        if self._broken is not None:
            raise self._broken
        return self._commander.chosen

    @property
    def by_hand(self) -> bool:
        """Whether a person moves the machine."""
        return isinstance(self._means.device, PersonMoves)

    def ask_with(self, ask: Ask) -> None:
        """Let a device that is moved by a person ask with this; others ask nothing."""
        if isinstance(self._means.device, PersonMoves):
            self._means.device.ask = ask

    def told(self, channels: Mapping[str, float]) -> None:
        """Hear state readings (``payload_kg``, ``structure_temp_C`` ...) for the next commands."""
        self._commander.conditions(channels)

    def _say_what_is_left(self) -> None:
        """Tell what a command did not compensate as it should, whenever that changes."""
        left = self._commander.left
        if left != self._said:
            self._said = left
            for what in left:
                alarm = Alarm(self.identity.kind, what, "Its error stays until somebody does")
                for hook in tuple(self._hooks):
                    hook(alarm)

    # what moves

    def on_alarm(self, callback: Callable[[Alarm], None]) -> None:
        """Call ``callback`` for what the device says unasked, and what is not compensated."""
        self._hooks.append(callback)
        self._means.device.on_alarm(callback)

    def check(self) -> None:
        """Raise the fault that stands at the device, if any."""
        self._means.device.check()

    async def state(self) -> ControllerState:
        """Read a snapshot, in the actuators of the machine."""
        return await self._means.state()

    async def frame(self) -> dict[str, str]:
        """What the poses of a closed controller refer to, in its own words; empty for motors."""
        return await self._means.frame()

    async def enable(self) -> None:
        """Bring all drives to operation enabled."""
        await self._means.device.enable()

    async def disable(self) -> None:
        """Take the power off all drives."""
        await self._means.device.disable()

    async def clear_faults(self) -> None:
        """Reset standing faults."""
        await self._means.device.clear_faults()

    async def home(self, actuator: str) -> None:
        """Find the reference of one actuator."""
        await self._means.home(actuator)

    async def move_to_pose(self, pose: tuple[float, ...]) -> tuple[float, ...]:
        """Command a pose with the set in use and start moving; returns q as it was sent."""
        _ = self.chosen
        self._commander.stands_at(tuple(_stands(a) for a in (await self.state()).actuators))
        extension = await asyncio.to_thread(self._commander.extension, pose)
        self._say_what_is_left()
        q = await self._means.send(extension)
        if not self.by_hand:  # a person says on arrival where it was brought
            self._commander.sent(q)
        return q

    async def play_poses(self, poses: Sequence[tuple[float, ...]], every_s: float) -> Array:
        """Run through poses, one each ``every_s`` seconds, with the set in use.

        The machine has been sent to the first of them before; :meth:`wait_arrived` waits for the
        end. Returns rows (N, n) of q as they are sent.

        Raises
        ------
        Refused
            Before anything moves: for drives that cannot, a pose that cannot be commanded, and
            what passes a limit, speed or acceleration.
        """
        device = self._means.device
        if not isinstance(device, PlaysRows):
            raise Refused(
                "it cannot run through a trajectory",
                device=self.identity.kind,
                remedy='Bare drives can, with mode = "cyclic"; others are sent pose by pose',
            )
        _ = self.chosen
        self._commander.stands_at(tuple(_stands(a) for a in (await self.state()).actuators))
        rows, history = await asyncio.to_thread(
            self._commander.trajectory, poses, every_s, device.accelerations
        )
        self._say_what_is_left()
        await device.play_actuators(rows.tolist(), every_s)
        self._commander.played(history)
        return rows

    async def move_to_actuators(self, q: tuple[float, ...]) -> tuple[float, ...]:
        """Command actuator coordinates as they are; returns q as it was sent."""
        self._commander.stands_at(tuple(_stands(a) for a in (await self.state()).actuators))
        sent = await self._means.send(self.machine.extension(np.array(q)[:, None])[:, 0])
        self._commander.sent(sent)
        return sent

    async def would_send(self, poses: Sequence[tuple[float, ...]], labels: Sequence[str]) -> Array:
        """Extensions (n, N) that these poses would be commanded with, one after the other.

        Nothing moves.

        Raises
        ------
        GateRefused
            Naming the pose that cannot be commanded.
        """
        _ = self.chosen
        commands = await asyncio.to_thread(self._commander.commands, poses)
        for label, why in zip(labels, commands.refused, strict=True):
            if why:
                raise GateRefused(
                    f"pose {label}: {why}",
                    remedy="Leave that pose out or choose poses with pkmcal poses; nothing has "
                    "moved",
                )
        return commands.extension

    async def wait_arrived(self, timeout: float) -> None:
        """Wait until everything that moves has reached its target."""
        await self._means.device.wait_arrived(timeout)
        if self.by_hand:
            self._commander.sent(tuple(one.position for one in (await self.state()).actuators))
        self._commander.arrived()

    def stop_at_once(self) -> None:
        """Quick stop from any thread, where the device can; never raises."""
        device = self._means.device
        if isinstance(device, StopsAtOnce):
            device.stop_at_once()

    async def stop(self) -> None:
        """Quick stop."""
        await self._means.device.stop()

    async def channels(self) -> dict[str, float]:
        """State readings of the device."""
        return await self._means.device.channels()

    async def close(self) -> None:
        """Release the link and the store; never raises."""
        await self._means.device.close()
        self._store.close()

    # parameters

    async def read_parameters(self) -> dict[str, float]:
        """Every value with which commands are computed now."""
        return dict(self.chosen.values)

    async def write_parameters(self, values: Mapping[str, float]) -> None:
        """Change some values of the set in use, until they are stored or the program ends.

        Raises
        ------
        Refused
            While a drive has power, or for a set that the host cannot compute with.
        """
        held = {} if self._broken is not None else self.chosen.values
        own = {} if self._broken is not None else self.chosen.own
        await self.replace_parameters(ParameterSet({**held, **values}, own))

    async def replace_parameters(self, chosen: ParameterSet) -> None:
        """Use a whole set instead, until it is stored or the program ends.

        Raises
        ------
        Refused
            While a drive has power, or for a set that the host cannot compute with.
        """
        if (await self.state()).enabled:
            raise Refused(
                "parameters are not changed while a drive has power",
                device=DEVICE,
                remedy="Take the power off the drives first",
            )
        self._use(chosen.checked(self.machine))

    async def parameter_checksum(self) -> int:
        """CRC-32 over the set in use."""
        return self.chosen.checksum

    async def store_parameters(self) -> None:
        """Write the set in use to the disk, under the next number."""
        await asyncio.to_thread(self._store.save, self.chosen)

    async def reload_parameters(self) -> None:
        """Bring the stored set back into use, read from the disk."""
        self._load()
        _ = self.chosen


def _stands(actuator: ActuatorState) -> float:
    """Where an actuator was last sent; where it is, if it was stopped short of that."""
    short = abs(actuator.position - actuator.target) > SHORT_OF_TARGET
    return actuator.position if short and not actuator.moving else actuator.target
