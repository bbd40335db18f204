"""A machine as it was identified: geometry and machine effects with their values."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from calib.arrays import Array, BoolArray
from calib.command.rows import empty_run, rows_with_everything
from calib.effects.component import Effect
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.runs.header import Load
from calib.runs.record import Run
from calib.runs.stack import STATES, Rows
from calib.unknown import linear_among


@dataclass(frozen=True, eq=False)
class Found:
    """A machine effect with what was found for its unknowns.

    ``names`` and ``values`` (U,) of its unknowns, ``linear`` (U,) which of them move the machine
    linearly, ``rest`` (U,) the values at which the effect adds nothing to its closure, ``needs``
    the channels without which it has no value.
    """

    effect: Effect
    names: tuple[str, ...]
    values: Array
    linear: BoolArray
    rest: Array
    needs: tuple[str, ...]

    @cached_property
    def amplitudes(self) -> Array:
        """Linear amplitudes (U,): zero in place of what is not linear."""
        return np.where(self.linear, self.values - self.rest, 0.0)


@dataclass(frozen=True, eq=False)
class Identified:
    """A machine, its parameters (P,) in mm or rad, and the effects that it really has.

    ``load`` says what it carries; without one there is no weight. ``controller`` holds the
    controller's own parameters, nominal where they are missing: its coordinates q refer to them.
    """

    machine: Machine
    parameters: Array
    effects: tuple[Found, ...] = ()
    load: Load | None = None
    controller: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def from_values(
        cls,
        machine: Machine,
        values: Mapping[str, float],
        effects: Sequence[Effect] = (),
        load: Load | None = None,
        controller: Mapping[str, float] | None = None,
    ) -> "Identified":
        """Build from values by name, as model files and controllers hold them.

        Parameters
        ----------
        values : mapping of str to float
            Parameters of the machine (nominal where they are missing) and unknowns of the effects.
        effects : sequence of Effect
            In the order of the model. Those of the measurement are left out: a machine is never
            commanded by them.

        Raises
        ------
        BadInput
            For an effect of which values are missing, or that no command can counter.
        """
        parameters = machine.nominal.copy()
        for name, index in machine.parameter_index.items():
            parameters[index] = values.get(name, parameters[index])
        found = tuple(
            _found(effect, values, machine, load) for effect in effects if commandable(effect)
        )
        return cls(machine, parameters, found, load, dict(controller or {}))

    @cached_property
    def closing(self) -> Machine:
        """The machine as its effects let it close."""
        machine = self.machine
        for found in self.effects:
            machine = found.effect.closure(machine, found.values)
        return machine

    @cached_property
    def run(self) -> Run:
        """A run without a row: effects ask it for the load."""
        return empty_run(self.load)

    @cached_property
    def lengths(self) -> tuple[Array, Array]:
        """What counts as 1 of extensions (n, 1) and of parameters (P, 1): size in mm, or 1 rad."""
        size = self.machine.size
        both = (self.machine.actuators, self.machine.parameters)
        extension, parameters = (
            np.array([1.0 if one.unit == "rad" else size for one in kind])[:, None] for kind in both
        )
        return extension, parameters

    @cached_property
    def twist_lengths(self) -> Array:
        """The same of twists, (6, 1)."""
        return np.array([self.machine.size] * 3 + [1.0] * 3)[:, None]

    @cached_property
    def names(self) -> tuple[str, ...]:
        """Parameters of the machine, then the unknowns of every effect."""
        own = tuple(parameter.name for parameter in self.machine.parameters)
        return own + tuple(name for found in self.effects for name in found.names)

    @cached_property
    def reference(self) -> Array:
        """What the coordinates q refer to, (n, 1), mm or rad."""
        return self.machine.reference(self.controller)[:, None]

    @cached_property
    def held_by_controller(self) -> Array:
        """Parameters (P,) as the controller holds them."""
        known = self.machine.parameter_index
        return self.machine.vector({k: v for k, v in self.controller.items() if k in known})

    @cached_property
    def needs(self) -> tuple[str, ...]:
        """Channels that every command must be told."""
        return tuple(dict.fromkeys(name for found in self.effects for name in found.needs))

    @cached_property
    def remembers_path(self) -> bool:
        """Whether an effect looks back on more than the last step of every actuator."""
        return any("path" in found.effect.depends for found in self.effects)

    @cached_property
    def needs_time(self) -> bool:
        """Whether an effect asks when the machine stands somewhere."""
        return any("time_s" in found.effect.depends for found in self.effects)

    @cached_property
    def motion(self) -> Array:
        """Changes (n,) of the commands up to which they are rounding, mm or rad."""
        return np.array([axis.motion for axis in self.machine.axes])


def commandable(effect: Effect) -> bool:
    """Whether a command can counter the effect; :func:`why_not` says why it cannot."""
    return not why_not(effect)


def why_not(effect: Effect) -> str:
    """Why no command counters an effect; empty if one does."""
    if effect.kind != "machine":
        return "it is of the measurement, not of the machine"
    if getattr(effect, "acts_on", "actuator") == "point":
        return "it moves the point that is read, which no command counters"
    if effect.of_its_run:
        return "it happened in that run, and is over since the machine was referenced anew"
    return ""


def _found(
    effect: Effect, values: Mapping[str, float], machine: Machine, load: Load | None
) -> Found:
    """Give an effect its values.

    A run without a channel that is not indispensable may have left some unknowns out (settling
    without delays): then the channel is not asked for.
    """
    told = {name for name in values if name.startswith(f"{effect.id}.")}
    spare = [c for c in effect.depends if c not in STATES and c not in effect.channels]
    rows = rows_with_everything(effect, machine, load)
    unknowns, rest = effect.unknowns(rows), effect.rest(rows)
    names = {one.name for one in unknowns}
    if told == names:
        spare = [name for name in spare if _names_without(effect, rows, [name]) == names]
    elif told != _names_without(effect, rows, spare):
        odd = sorted(told - names) or sorted(names - told)
        raise BadInput(
            f"the effect {effect.id} on the machine {machine.name} "
            + (f"knows no {odd[0]}" if told - names else f"lacks a value of {odd[0]}"),
            remedy="Fit again with this machine file, and save the model",
        )
    kept = [k for k, one in enumerate(unknowns) if one.name in told]
    needs = dict.fromkeys(c for c in (*effect.channels, *effect.depends) if c not in STATES)
    return Found(
        effect=effect,
        names=tuple(unknowns[k].name for k in kept),
        values=np.array([values[unknowns[k].name] for k in kept], dtype=np.float64),
        linear=linear_among(unknowns)[kept],
        rest=rest[kept],
        needs=tuple(name for name in needs if name not in spare),
    )


def _names_without(effect: Effect, rows: Rows, channels: Sequence[str]) -> set[str]:
    left = {name: values for name, values in rows.channels.items() if name not in channels}
    return {one.name for one in effect.unknowns(replace(rows, channels=left))}
