"""The set of parameters with which the host computes the motion of a machine."""

import json
import math
import zlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from calib.mechanism.description import Machine
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
        strange = [name for name in self.values if name not in machine.parameter_index]
        if strange:
            raise Refused(
                f'"{strange[0]}" is no parameter of the machine {machine.name}',
                device=DEVICE,
                remedy="Write names of the machine file",
            )
        return self
