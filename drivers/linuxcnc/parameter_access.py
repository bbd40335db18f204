"""Parameters as genhexkins and the joints hold them: read and set by their pins, bit for bit."""

import math
import zlib
from collections.abc import Mapping

from drivers.errors import ParameterError, Refused
from drivers.linuxcnc.link import Ask
from drivers.linuxcnc.places import MUST_BE_ZERO, Places

POWER_S = 15.0
"""Seconds that a change of state may take; the helper waits for several, one after the other."""


class ParameterAccess:
    """The pins of one LinuxCNC."""

    def __init__(self, ask: Ask, places: Places, device: str) -> None:
        self._ask, self._places, self._device = ask, places, device

    async def pins(self) -> dict[str, float]:
        """Every pin that holds a parameter, or that parameters hang on; raises Refused."""
        places = self._places
        wanted = [*places.pins, *places.normals(), *MUST_BE_ZERO]
        try:
            return dict((await self._ask("get", pins=wanted))["values"])
        except Refused as error:
            raise Refused(
                f"a pin of genhexkins is missing ({error.what})",
                device=self._device,
                remedy="Load genhexkins in the HAL file: loadrt genhexkins",
            ) from error

    async def read(self) -> dict[str, float]:
        """Every parameter by name."""
        return self._places.parameters(await self.pins())

    async def checksum(self) -> int:
        """CRC-32 over the parameters as the pins have them."""
        values = await self.read()
        text = "\n".join(f"{name} {value!r}" for name, value in sorted(values.items()))
        return zlib.crc32(text.encode())

    async def write(self, values: Mapping[str, float]) -> None:
        """Set the pins of some parameters; raises Refused (naming one) or ParameterError."""
        chosen = {name: float(value) for name, value in values.items()}
        before = await self.pins()
        held = self._places.parameters(before)
        for name, value in chosen.items():
            if name not in held or not math.isfinite(value):
                what = f"cannot hold {name} = {value}" if name in held else f"has no {name}"
                raise Refused(what, device=self._device, remedy="Nothing was written")
        if (await self._ask("state"))["on"]:
            raise self.is_on()
        await self.load(self._places.to_pins({**held, **chosen}, before), before)

    def is_on(self) -> Refused:
        """What is said where the machine must be off."""
        return Refused(
            "is on",
            device=self._device,
            remedy="Switch the machine off before parameters are written",
        )

    async def load(self, pins: Mapping[str, float], before: Mapping[str, float]) -> None:
        """Set what differs and forget the references; raises ParameterError.

        L0 is a joint's place at its home switch, so every joint is to be homed again.
        """
        changed = {name: value for name, value in pins.items() if before[name] != value}
        if not changed:
            return
        found = (await self._ask("set", pins=changed))["values"]
        different = [name for name, value in changed.items() if found[name] != value]
        if different:
            raise ParameterError(
                f"{different[0]} is {found[different[0]]!r}, {changed[different[0]]!r} was set",
                device=self._device,
                remedy="A pin that a signal drives cannot be set; take it out of the HAL file",
            )
        await self._ask("unhome", POWER_S)
        if any((await self._ask("state"))["homed"]):
            raise ParameterError(
                "keeps the references of its joints, which are no longer true",
                device=self._device,
                remedy="Home all joints again before anything moves",
            )
