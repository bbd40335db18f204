"""Which parameter is which HAL pin of genhexkins and of LinuxCNC's joints.

=====================  ==========================================================================
``leg1.B_x``           ``genhexkins.base.0.x``; ``P`` is ``platform``
``leg1.L0``            ``ini.0.home_offset``, what the joint counts at its home switch, less the
                       turn of its screw there; ``ini.0.home`` goes along
``screw-twist.L``      ``genhexkins.screw-lead``, with the other sign
``backlash.leg1``      ``ini.0.backlash``
=====================  ==========================================================================

genhexkins lengthens a strut by lead / 2 pi times the angle between the second axes of its two
joints; ours counts that turn from home. What is between goes into the home offset::

    home_offset = L0 + c,  c = screw-lead turn_at_home / (2 pi)

c is rounded to 2**-30 mm, so that L0 + c - c is L0 to the last bit.
"""

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from drivers.errors import ParameterError, Refused
from drivers.kind import Strut

AXES = ("x", "y", "z")
LEAD, TWIST = "genhexkins.screw-lead", "screw-twist.L"
MUST_BE_ZERO = ("genhexkins.spindle-offset", "genhexkins.tool-offset")
GRID = 2.0**30
SAME = 1e-6
"""How much a joint normal may differ, each component of a unit vector."""
MOST_TURN = math.pi / 2.0
_NAME = re.compile(r"(\w+)\.(?:([BP])_([xyz])|(L0))$")
_OF_PIN = {"B": "base", "P": "platform"}


@dataclass(frozen=True)
class Places:
    """Pins of the six struts; ``limbs`` are their names in the order of joints 0 ... 5.

    ``struts`` is empty for struts that are guided: screw-twist is then no parameter.
    """

    limbs: tuple[str, ...]
    names: tuple[str, ...]
    struts: tuple[Strut, ...]

    @classmethod
    def of(cls, parameters: Sequence[str], struts: Sequence[Strut]) -> "Places":
        """From the names of a machine's parameters.

        Raises Refused for a machine that genhexkins cannot hold.
        """
        found = {name: _NAME.match(name) for name in parameters}
        foreign = [name for name, parts in found.items() if parts is None]
        limbs = tuple(dict.fromkeys(parts[1] for parts in found.values() if parts))
        if foreign or len(limbs) != 6 or len(parameters) != 42:
            said = f"{foreign[0]} of the machine file" if foreign else f"{len(limbs)} struts"
            raise Refused(
                f"genhexkins has no place for {said}",
                device="linuxcnc",
                remedy="Use a machine file of six struts with B, P and L0: "
                "pkmcal machine new FILE --kind linuxcnc",
            )
        wide = [one for one in struts if abs(one.home_turn) >= MOST_TURN]
        if wide:
            raise Refused(
                f"the cross axes of {wide[0].limb} stand {math.degrees(wide[0].home_turn):.0f} deg "
                "apart at home, genhexkins counts up to 90",
                device="linuxcnc",
                remedy="Turn one of its joint normals round, in the machine and the HAL file",
            )
        return cls(limbs, tuple(parameters), tuple(struts))

    @property
    def effects(self) -> tuple[str, ...]:
        """Compensation values that LinuxCNC has."""
        own = tuple(f"backlash.{limb}" for limb in self.limbs)
        return (TWIST, *own) if self.struts else own

    @property
    def pins(self) -> list[str]:
        """Every pin that holds a parameter."""
        points = [
            f"genhexkins.{body}.{n}.{axis}"
            for n in range(len(self.limbs))
            for body in _OF_PIN.values()
            for axis in AXES
        ]
        joints = [
            f"ini.{n}.{what}"
            for n in range(len(self.limbs))
            for what in ("home_offset", "home", "backlash")
        ]
        return [*points, LEAD, *joints]

    def normals(self) -> dict[str, float]:
        """What the pins of the joint normals must be, by the machine file."""
        return {
            f"genhexkins.{body}-n.{n}.{axis}": normal[k]
            for n, strut in enumerate(self.struts)
            for body, normal in (("base", strut.base_normal), ("platform", strut.platform_normal))
            for k, axis in enumerate(AXES)
        }

    def check(self, pins: Mapping[str, float]) -> None:
        """Refuse pins that mean another machine than the file does."""
        for name in MUST_BE_ZERO:
            if pins[name] != 0.0:
                raise Refused(
                    f"{name} is {pins[name]:g}, poses would mean another point",
                    device="linuxcnc",
                    remedy="Set it to 0, and put the offset into the joint centres",
                )
        if not self.struts and pins[LEAD] != 0.0:
            raise Refused(
                f"{LEAD} is {pins[LEAD]:g} mm, the machine file has no screws without a guide",
                device="linuxcnc",
                remedy="State the trait screw in the machine file, or set the lead to 0",
            )
        for name, wanted in self.normals().items():
            if abs(pins[name] - wanted) > SAME:
                raise Refused(
                    f"{name} is {pins[name]:.6f}, by the machine file {wanted:.6f}",
                    device="linuxcnc",
                    remedy="Set the joint normals in the HAL file as the machine file has them: "
                    "the turn of the screws is counted from them",
                )

    def parameters(self, pins: Mapping[str, float]) -> dict[str, float]:
        """Parameters by name from the values of :attr:`pins`."""
        values = {}
        for name in self.names:
            n, point, axis = self._parts(name)
            if point:
                values[name] = pins[f"genhexkins.{point}.{n}.{axis}"]
            else:
                values[name] = pins[f"ini.{n}.home_offset"] - self._turned(n, pins[LEAD])
        if self.struts:
            values[TWIST] = 0.0 - pins[LEAD]  # never -0.0
        for joint, limb in enumerate(self.limbs):
            values[f"backlash.{limb}"] = pins[f"ini.{joint}.backlash"]
        return values

    def to_pins(self, values: Mapping[str, float], now: Mapping[str, float]) -> dict[str, float]:
        """Pins for all parameters; ``now`` are the pins as they are.

        Raises
        ------
        ParameterError
            For an L0 that would not come back to the last bit.
        """
        lead = 0.0 - values.get(TWIST, 0.0)
        pins = {LEAD: lead}
        for name in self.names:
            n, point, axis = self._parts(name)
            if point:
                pins[f"genhexkins.{point}.{n}.{axis}"] = values[name]
                continue
            turned = self._turned(n, lead)
            offset = values[name] + turned
            if offset - turned != values[name]:
                raise ParameterError(
                    f"{name} = {values[name]!r} and the turn of its screw have no sum that "
                    "gives it back to the last bit",
                    device="linuxcnc",
                    remedy="Round it to a nanometre",
                )
            rest = now[f"ini.{n}.home"] - now[f"ini.{n}.home_offset"]
            pins[f"ini.{n}.home_offset"] = offset
            pins[f"ini.{n}.home"] = offset + rest
        for joint, limb in enumerate(self.limbs):
            pins[f"ini.{joint}.backlash"] = values[f"backlash.{limb}"]
        return pins

    def lengths(
        self, pins: Mapping[str, float], position: Sequence[float], rotation: Sequence[float]
    ) -> tuple[float, ...]:
        """Distances of the joint centres at a pose, as genhexkins has them, mm.

        ``rotation`` is a matrix, row after row.
        """
        found = []
        for n in range(len(self.limbs)):
            base, own = (
                [pins[f"genhexkins.{body}.{n}.{axis}"] for axis in AXES]
                for body in _OF_PIN.values()
            )
            placed = [
                position[k] + sum(rotation[3 * k + j] * own[j] for j in range(3)) for k in range(3)
            ]
            found.append(math.dist(placed, base))
        return tuple(found)

    def _parts(self, name: str) -> tuple[int, str, str]:
        """Joint, "base" | "platform" | "" for L0, and axis."""
        parts = _NAME.match(name)
        assert parts is not None
        return self.limbs.index(parts[1]), _OF_PIN.get(parts[2] or "", ""), parts[3] or ""

    def _turned(self, joint: int, lead: float) -> float:
        """c of one strut, mm."""
        if not self.struts:
            return 0.0
        exact = lead * self.struts[joint].home_turn / (2.0 * math.pi)
        return round(exact * GRID) / GRID
