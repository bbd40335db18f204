"""From wanted poses to the extensions that are commanded, everything compensated that was found."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from app.hosted.parameters import ParameterSet
from calib.arrays import Array
from calib.command import Commands, History, Identified, Surroundings, Trajectory, commands_for
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.runs.header import Load
from drivers.errors import Refused

AT_REFERENCE = {"structure_temp_C": 20.0, "payload_kg": 0.0, "delay_s": 0.0}
"""Where an effect is applied whose channel nobody tells."""
BETWEEN_S = 20.0
"""Machine seconds from one pose to the next, as long as none was timed."""


class Commander:
    """Computes commands with a parameter set, the conditions as told, and what was sent before.

    Parameters
    ----------
    machine : Machine
    chosen : ParameterSet
    load : Load or None
        What the machine carries, as the site file says.
    clock : callable
        Machine seconds; never goes back.
    """

    def __init__(
        self,
        machine: Machine,
        chosen: ParameterSet,
        load: Load | None,
        clock: Callable[[], float],
    ) -> None:
        self.chosen = chosen
        self._machine = machine
        self._load = load
        self._clock = clock
        self.left: tuple[str, ...] = ()
        """What the last command could not compensate as it should, and why, in sentences."""
        self._told: dict[str, float] = {}
        self._history: History | None = None
        self._travel_s = BETWEEN_S
        self._whole = chosen.identified(machine, load)

    def with_set(self, chosen: ParameterSet) -> "Commander":
        """The same machine, conditions and past, with another parameter set."""
        other = Commander(self._machine, chosen, self._load, self._clock)
        other._told, other._history, other._travel_s = self._told, self._history, self._travel_s
        return other

    def conditions(self, channels: Mapping[str, float]) -> None:
        """Take state readings for the commands to come; what is not finite is not told."""
        self._told = {name: v for name, v in channels.items() if np.isfinite(v)}

    def stands_at(self, q: tuple[float, ...]) -> None:
        """Hear where the device was last sent: after a stop, or before the first command.

        Parameters
        ----------
        q : tuple of float
            Actuator coordinates by the drawing; nan where it is not known.
        """
        extension = self._machine.extension(np.array(q)[:, None])[:, 0]
        if not np.all(np.isfinite(extension)):
            return
        if self._history is None:
            self._history = History.at(extension, self._clock())
        elif np.any(np.abs(extension - self._history.extension[:, -1]) > self._whole.motion):
            self._history = self._history.then(extension, self._clock())

    def sent(self, q: tuple[float, ...]) -> None:
        """Remember a command that was accepted."""
        self.stands_at(q)
        if self._history is not None:
            self._history = self._history.condensed(
                self._whole.motion, whole_path=self._whole.remembers_path
            )

    def arrived(self) -> None:
        """Remember how long the last move took."""
        if self._history is not None and self._history.count > 1:
            self._travel_s = max(self._clock() - float(self._history.time_s[-1]), 0.0)

    def extension(self, pose: Sequence[float]) -> Array:
        """Extensions (n,), mm or rad, that bring the platform to task coordinates.

        Raises
        ------
        Refused
            For what is no pose, cannot be reached, or passes a limit.
        """
        commands = self.commands([tuple(pose)])
        if why := commands.refused[0]:
            raise Refused(
                f"the pose is refused: {why}",
                device="host's computation",
                remedy="Choose another pose",
            )
        found: Array = commands.extension[:, 0]
        return found

    def trajectory(
        self, poses: Sequence[Sequence[float]], every_s: float, accelerations: Sequence[float]
    ) -> tuple[Array, History]:
        """Rows (N, n) of q for poses ``every_s`` apart, and what is then known of the way.

        Lost motion is taken up as ``accelerations`` (n,) allow. Nothing is remembered.

        Raises
        ------
        Refused
            For what is no pose, or cannot be commanded, with its number.
        """
        self._check(poses)
        if not poses:
            raise Refused(
                "no pose is no trajectory", device="host's computation", remedy="Give some"
            )
        identified, channels, self.left = self._in_these_conditions()
        way = Trajectory(identified, self._history)
        around = Surroundings(channels, self._clock())
        try:
            rows = way.rows(
                np.array(poses, float).T, every_s, around, acceleration=np.array(accelerations)
            )
        except BadInput as error:
            raise Refused(error.what, device="host's computation", remedy=error.remedy) from error
        return rows, way.history

    def played(self, history: History) -> None:
        """Remember a trajectory that was accepted, as :meth:`trajectory` said."""
        self._history = history

    def commands(self, poses: Sequence[Sequence[float]]) -> Commands:
        """Commands for poses one after the other; nothing is remembered.

        Raises
        ------
        Refused
            For what is no pose.
        """
        self._check(poses)
        identified, channels, self.left = self._in_these_conditions()
        begins = self._clock() + self._travel_s
        times: Array = begins + (self._travel_s or BETWEEN_S) * np.arange(len(poses), dtype=float)
        around = Surroundings(channels, times)
        history = self._history or History.at_home(self._machine)
        try:
            return commands_for(identified, np.array(poses, float).T, around, history)
        except BadInput as error:
            raise Refused(error.what, device="host's computation", remedy=error.remedy) from error

    def _check(self, poses: Sequence[Sequence[float]]) -> None:
        count = len(self._machine.task.coordinates)
        for pose in poses:
            if len(pose) != count or not np.all(np.isfinite(pose)):
                raise Refused(
                    f"{tuple(pose)} is no pose: {count} finite numbers are",
                    device="host's computation",
                    remedy="Command one",
                )

    def _in_these_conditions(self) -> tuple[Identified, dict[str, float], tuple[str, ...]]:
        """The machine, every channel that its effects need, and what nobody tells.

        An effect whose channel nobody tells is applied at its reference; one that has none is
        left out.
        """
        whole, channels, said = self._whole, dict(self._told), []
        wanted = dict.fromkeys(
            name
            for found in whole.effects
            for name in (*found.needs, *found.effect.depends)
            if name in found.needs or name == "payload_kg"
        )
        idle = set()
        for name in wanted:
            if name in channels:
                continue
            who = [f.effect.id for f in whole.effects if name in (*f.needs, *f.effect.depends)]
            if name in AT_REFERENCE:
                channels[name] = AT_REFERENCE[name]
                said.append(
                    f"nobody tells {name}: {', '.join(who)} compensated for {AT_REFERENCE[name]:g}"
                )
            else:
                idle |= set(who)
                said.append(f"nobody tells {name}: {', '.join(who)} not compensated")
        if idle:
            kept = tuple(found for found in whole.effects if found.effect.id not in idle)
            whole = Identified(whole.machine, whole.parameters, kept, whole.load)
        return whole, channels, tuple(said)
