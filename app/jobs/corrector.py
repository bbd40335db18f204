"""From wanted poses to commands, with a model from a file; nothing moves."""

import gc
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from app.errors import GateRefused
from app.files.fits import SavedFit, read_fit
from app.files.machines import load_machine
from app.files.models import chosen_effects
from calib.arrays import Array
from calib.command import (
    Commands,
    Excess,
    History,
    Identified,
    PoseCovariance,
    Surroundings,
    Trajectory,
    commands_for,
    pose_commands,
)
from calib.command.identified import why_not
from calib.command.region import Walls
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.mechanism.rigid import Poses
from calib.mechanism.solve import home_configuration
from calib.mechanism.task import FULL, task_values

PAYLOAD, TEMPERATURE = "payload_kg", "structure_temp_C"


@dataclass(frozen=True, eq=False)
class Corrector:
    """A machine as its model has it, and what the model file says about that.

    ``left_out`` says of every effect that no command counters why.
    """

    source: str
    machine: Machine
    identified: Identified
    saved: SavedFit
    left_out: Mapping[str, str]

    @classmethod
    def load(cls, model: Path, machine: str | None = None) -> "Corrector":
        """Read a model file, and the machine that it names.

        Raises
        ------
        BadInput
            If the file has no values, or is of another machine.
        """
        saved = read_fit(model)
        described = machine_of(model, saved, machine)
        values = _values(saved, described)
        effects = chosen_effects(described, (), model)
        left_out = {effect.id: why for effect in effects if (why := why_not(effect))}
        identified = Identified.from_values(
            described, values, effects, saved.load, saved.controller
        )
        return cls(str(model), described, identified, saved, left_out)

    @cached_property
    def walls(self) -> Walls | None:
        """The ends of where it was measured; None if the model file does not say."""
        return None if self.saved.region is None else self.saved.region.walls(self.machine)

    @cached_property
    def covariance(self) -> PoseCovariance:
        """How sure the model is of where the platform comes to."""
        known = np.where(np.isfinite(self.saved.covariance), self.saved.covariance, 0.0)
        return PoseCovariance(self.identified, list(self.saved.estimates), known)

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Task coordinates of the machine, mm and rad."""
        return self.machine.task.coordinates

    @property
    def remarks(self) -> list[str]:
        """What an operator should know of the model."""
        said = []
        if self.saved.region is None:
            said.append(
                "The model file does not say where it was measured: whether poses lie outside is "
                "not known. Fit again and save it"
            )
        held = sorted(name for name, value in (self.saved.compensation or {}).items() if value)
        if held:
            said.append(
                f"While the runs were taken the controller compensated {', '.join(held)}: the "
                "commands are for a controller that still does so"
            )
        return said

    def history(self) -> History:
        """A machine that was referenced and stands at home."""
        machine = self.machine
        s = machine.extension(machine.home_q[:, None], self.identified.controller)
        return History.at(s[:, 0])

    def warm_up(self) -> None:
        """Answer for the pose at home once, whatever its channels are: what is kept is made then.

        Nothing is told of it, and what was made is not looked at for garbage any more.
        """
        home = task_values(self.machine.task, home_configuration(self.machine).poses)
        told = {name: 20.0 if name.endswith("_C") else 0.0 for name in self._asked_for}
        with suppress(BadInput):  # a formula may have no value there
            self.solve(home, told, 0.0, Trajectory(self.identified, self.history())).entries()
        gc.collect()
        gc.freeze()

    def task_of(self, values: Sequence[float], place: str = "") -> Array:
        """Task coordinates (k,) of a pose: k numbers, or the six of a whole pose.

        Raises
        ------
        BadInput
            If it has another number of them, or one is not finite.
        """
        names = self.coordinates
        if len(values) not in (len(names), 6) or not np.all(np.isfinite(values)):
            either = f"{', '.join(names)}" + ("" if names == FULL else f", or {', '.join(FULL)}")
            raise BadInput(
                f"{len(values)} numbers are no pose of {self.machine.name}"
                if np.all(np.isfinite(values))
                else "a pose has numbers that are not finite",
                place=place,
                remedy=f"Give {either} in mm and rad",
            )
        column = np.array(values, dtype=np.float64)[:, None]
        whole = len(values) == 6 and names != FULL
        task = task_values(self.machine.task, Poses.from_xyz_rpy(column)) if whole else column
        return np.asarray(task[:, 0])

    def channels(self, told: Mapping[str, Any]) -> dict[str, Any]:
        """What is told, and what need not be: channels that did not vary while it was measured.

        Raises
        ------
        BadInput
            For a channel that an effect depends on and that nobody tells.
        """
        found = dict(told)
        payload = found.get(PAYLOAD, 0.0)
        if payload < 0.0 if isinstance(payload, float) else np.any(np.asarray(payload) < 0.0):
            raise BadInput(f"{PAYLOAD} is negative", remedy="Give the mass on the platform, kg")
        region = self.saved.region
        for name in self._asked_for:
            if name in found:
                continue
            ends = region.channels.get(name) if region is not None else None
            if ends is not None and ends[0] == ends[1]:
                found[name] = ends[0]
            elif name != PAYLOAD or ends is not None:
                raise BadInput(
                    f"{self._who(name)} depends on {name}, and that is not told",
                    remedy=f"Say it: {_option(name)}",
                )
        return found

    @cached_property
    def _asked_for(self) -> tuple[str, ...]:
        heavy = any(PAYLOAD in f.effect.depends for f in self.identified.effects)
        return tuple(dict.fromkeys((*self.identified.needs, *([PAYLOAD] if heavy else []))))

    def _who(self, channel: str) -> str:
        return next(
            f.effect.id
            for f in self.identified.effects
            if channel in f.needs or channel in f.effect.depends
        )

    def solve(
        self,
        task: Array,
        channels: Mapping[str, Any],
        time_s: Array | float | None,
        before: History | Trajectory,
    ) -> "Solved":
        """Commands for task coordinates (k, N), one after the other; raises BadInput.

        ``before`` is what was commanded; a trajectory also begins where it ended, and is not told
        that these were sent.
        """
        if self.identified.needs_time and time_s is None:
            who = next(f.effect.id for f in self.identified.effects if "time_s" in f.effect.depends)
            raise BadInput(
                f"{who} depends on the time, and that is not told",
                remedy="Say time_s of every pose, or --every SECONDS",
            )
        here = Surroundings(self.channels(channels), time_s)
        if isinstance(before, Trajectory):
            found = before.solve(task, here, keep=False)
        else:
            found = commands_for(self.identified, task, here, before)
        return Solved(self, found, {n: here.channel(n, task.shape[1]) for n in here.channels})


@dataclass(frozen=True, eq=False)
class Solved:
    """Commands for N poses, and how far each lies outside of where the model was measured."""

    corrector: Corrector
    commands: Commands
    channels: Mapping[str, Array]
    outside: tuple[tuple[Excess, ...], ...] = field(init=False)

    def __post_init__(self) -> None:
        found, walls = self.commands, self.corrector.walls
        by_pose: list[list[Excess]] = [[] for _ in found.refused]
        if walls is not None:
            for one in walls.outside(found.wanted, found.q, self.channels):
                by_pose[one.pose].append(one)
        object.__setattr__(self, "outside", tuple(map(tuple, by_pose)))

    def check(self, names: Sequence[str], *, extrapolate: bool) -> None:
        """Refuse what cannot be commanded, and what lies outside.

        Raises
        ------
        BadInput
            For a pose that is out of reach or does not converge.
        GateRefused
            For one outside of where the model was measured, unless ``extrapolate``.
        """
        for name, why in zip(names, self.commands.refused, strict=True):
            if why:
                raise BadInput(f"{name}: {why}", remedy="Leave the pose out, or move it inward")
        far = [(name, one) for name, one in zip(names, self.outside, strict=True) if one]
        if far and not extrapolate:
            name, first = far[0]
            more = f" ({len(far)} of {len(names)} poses are outside)" if len(far) > 1 else ""
            raise GateRefused(
                f"{name}: {'; '.join(map(str, first))}{more}",
                remedy="Measure there too, or ask with --extrapolate",
            )

    def entries(self) -> list[dict[str, Any]]:
        """What is said of every pose; see :class:`app.jobs.correcting.CorrectedEntry`."""
        found, names = self.commands, self.corrector.coordinates
        told = pose_commands(self.corrector.identified, found).to_xyz_rpy()
        stands = found.standing.poses.to_xyz_rpy()
        um, mdeg = self.uncertainty()
        columns = (found.wanted.T, found.q.T, told.T, stands.T, um, mdeg)
        return [
            {
                "wanted": dict(zip(names, wanted, strict=True)),
                "q": q,
                "pose": pose,
                "stands": stands_at,
                "uncertainty_um": um_here,
                "uncertainty_mdeg": mdeg_here,
                "outside": [str(one) for one in outside],
            }
            for wanted, q, pose, stands_at, um_here, mdeg_here, outside in zip(
                *(column.tolist() for column in columns), self.outside, strict=True
            )
        ]

    def uncertainty(self) -> tuple[Array, Array]:
        """Standard uncertainty (N,) of place in um (3D) and of direction in mdeg."""
        covariance = self.corrector.covariance.at(self.commands.standing)
        variance = np.einsum("iin->in", covariance)
        place, turn = variance[:3].sum(axis=0), variance[3:].sum(axis=0)
        return 1e3 * np.sqrt(np.maximum(place, 0.0)), 1e3 * np.rad2deg(
            np.sqrt(np.maximum(turn, 0.0))
        )


def machine_of(model: Path, saved: SavedFit, named: str | None) -> Machine:
    """The machine that is named, or that the model file names; raises BadInput."""
    if named is None and not (saved.machine or saved.machine_file):
        raise BadInput(
            "the model file names no machine", place=str(model), remedy="Name it with --machine"
        )
    if named is None:
        try:
            machine = load_machine(saved.machine_file or saved.machine, model.parent)
        except BadInput as error:
            if error.place:
                raise
            raise BadInput(
                error.what, place=f"{model}, machine", remedy="Name its file with --machine"
            ) from error
    else:
        machine = load_machine(named)
    if saved.machine and machine.name != saved.machine:
        raise BadInput(
            f'it is of the machine "{saved.machine}", not of "{machine.name}"',
            place=str(model),
            remedy="Name the machine that was measured",
        )
    return machine


def _values(saved: SavedFit, machine: Machine) -> dict[str, float]:
    values = {name: estimate.value for name, estimate in saved.estimates.items()}
    # An error that the machine's file has got since the model was saved is zero, as it is drawn.
    needed = [p.name for p in machine.parameters if p.sigma > 0.0 and p.nominal != 0.0]
    missing = [name for name in needed if name not in values]
    unknown = [name for name, value in values.items() if not np.isfinite(value)]
    if missing or unknown:
        raise BadInput(
            f"it has no value of {(missing or unknown)[0]}",
            place=saved.source,
            remedy="Fit a run and save what was found: pkmcal fit RUN --save FILE",
        )
    return values


def _option(channel: str) -> str:
    known = {PAYLOAD: "--payload KG", TEMPERATURE: "--temperature DEG_C"}
    return known.get(channel, f"--channel {channel}=...")
