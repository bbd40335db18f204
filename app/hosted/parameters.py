"""The set of parameters with which the host computes the motion of a machine."""

import json
import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from calib.command import Identified
from calib.command.identified import commandable
from calib.effects import Effect, effect_named, is_shipped
from calib.errors import BadInput
from calib.formulas.effect_file import effect_from_text
from calib.mechanism.description import Machine
from calib.runs.header import Load
from drivers.errors import Refused

DEVICE = "host store"


@dataclass(frozen=True)
class ParameterSet:
    """Geometry of the machine, then the effects that are compensated.

    Attributes
    ----------
    values : mapping of str to float
        By name; mm, rad, or the unit of an effect's unknown.
    own : mapping of str to str
        Texts of the operator's own effects among them, by their ids.
    """

    values: Mapping[str, float]
    own: Mapping[str, str] = field(default_factory=dict)

    @staticmethod
    def nominal(machine: Machine) -> "ParameterSet":
        """As the machine is drawn: nothing is compensated."""
        return ParameterSet({p.name: p.nominal for p in machine.parameters})

    @cached_property
    def checksum(self) -> int:
        """CRC-32 over names, values bit for bit, and the texts of own effects."""
        said = [[name, value.hex()] for name, value in sorted(self.values.items())]
        return zlib.crc32(json.dumps([said, sorted(self.own.items())]).encode("utf-8"))

    def checked(self, machine: Machine) -> "ParameterSet":
        """The same set, if the host can compute with it.

        Raises
        ------
        Refused
            Naming a value that is no finite number, a parameter that is missing, or a name that
            means nothing for this machine.
        """
        odd = [name for name, value in self.values.items() if not math.isfinite(value)]
        if odd:
            raise Refused(
                f"{odd[0]} = {self.values[odd[0]]} is no finite number",
                device=DEVICE,
                remedy="Nothing was changed",
            )
        missing = [p.name for p in machine.parameters if p.name not in self.values]
        if missing:
            raise Refused(
                f"{len(missing)} of {len(machine.parameters)} parameters are missing, the first "
                f"is {missing[0]}",
                device=DEVICE,
                remedy="Write a whole set",
            )
        self.identified(machine, None)
        return self

    def effects(self, machine: Machine) -> list[Effect]:
        """The effects that are compensated, in the order of their values.

        Raises
        ------
        Refused
            For a name that is neither of the machine nor of an effect that is known here.
        """
        others = [name for name in self.values if name not in machine.parameter_index]
        found: list[Effect] = []
        for name in others:
            identifier = name.split(".")[0]
            if identifier in {effect.id for effect in found}:
                continue
            if identifier not in self.own and not is_shipped(identifier):
                raise Refused(
                    f'"{name}" is no parameter of the machine {machine.name}, nor of an effect',
                    device=DEVICE,
                    remedy="Nothing was changed",
                )
            try:
                found.append(effect_of(identifier, machine, self.own))
            except BadInput as error:
                raise Refused(error.what, device=DEVICE, remedy=error.remedy) from error
        return found

    def identified(self, machine: Machine, load: Load | None) -> Identified:
        """The machine with these parameters and effects, for computing commands.

        Raises
        ------
        Refused
            For an effect that is not complete, or that no command can counter.
        """
        effects = self.effects(machine)
        if idle := [effect.id for effect in effects if not commandable(effect)]:
            raise Refused(
                f"{idle[0]} is no effect of the machine that a command can counter",
                device=DEVICE,
                remedy="Write effects of the machine only",
            )
        try:
            return Identified.from_values(machine, self.values, effects, load)
        except BadInput as error:
            raise Refused(error.what, device=DEVICE, remedy=error.remedy) from error


def effect_of(identifier: str, machine: Machine, own: Mapping[str, str]) -> Effect:
    """An effect by its id: the operator's own where its text is there, else one that ships.

    Raises
    ------
    BadInput
        For one that is not known, or a text that is no effect.
    """
    if identifier in own:
        effect = effect_from_text(own[identifier], f"own effect {identifier}")
        if effect.id != identifier:
            raise BadInput(
                f"the text of the own effect {identifier} is that of {effect.id}",
                remedy="Fit again and save the model",
            )
        return effect
    return effect_named(identifier, machine)
