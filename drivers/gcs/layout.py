"""What the controller's ``HPA?`` says about its parameters.

The identifiers are this project's own (docs/protocols/gcs.md); their meaning is read from the
controller: an entry of group ``limb`` named ``h`` with three items holds limb1.h, limb2.h and
limb3.h (``leg``, ``tower`` ...: as the machine file calls its limbs); entries of group ``channel``
are state readings.
"""

import re
from collections.abc import Iterable
from dataclasses import dataclass

from drivers.errors import ProtocolError

CRC_IN_USE, CRC_STORED, WATCHDOG = 0x7F030001, 0x7F030002, 0x7F030003
LIMB, CHANNEL = "limb", "channel"
Address = tuple[str, int]
"""Item and identifier."""

_ENTRY = re.compile(r"0x([0-9A-Fa-f]{1,8})=\s*(\d+)\s+([0-9]{1,4})\s+(\w+)\t([^\t]+)\t([^\t]+)")


@dataclass(frozen=True)
class Layout:
    """Where things are: name -> (item, identifier).

    ``parameters`` are in the order of the checksum: limb by limb, identifiers in turn.
    """

    parameters: dict[str, Address]
    channels: dict[str, Address]
    watchdog: bool


def groups_of(parameters: Iterable[str]) -> frozenset[str]:
    """What a machine calls its limbs, without their numbers: {"leg"} of leg1.h, leg2.h ..."""
    found = (re.match(r"([A-Za-z_]+)\d+\.", name) for name in parameters)
    return frozenset(match[1] for match in found if match) or frozenset({LIMB})


def read_layout(
    lines: list[str], device: str, groups: frozenset[str] = frozenset({LIMB})
) -> Layout:
    """Read the answer to ``HPA?``; raises ProtocolError if it lists no kinematic parameters.

    ``groups`` are those whose entries are kinematic parameters, one item a limb.
    """
    parameters: dict[str, Address] = {}
    channels: dict[str, Address] = {}
    numbers = set()
    for line in lines:
        entry = _ENTRY.match(line)
        if entry is None:
            continue
        number, items = int(entry[1], 16), int(entry[3])
        group, says = entry[5].strip(), entry[6].strip()
        numbers.add(number)
        if group in groups:
            for item in range(1, items + 1):
                parameters[f"{group}{item}.{says}"] = (str(item), number)
        elif group == CHANNEL:
            channels[says] = ("1", number)
    if not parameters or CRC_IN_USE not in numbers:
        raise ProtocolError(
            f"lists no kinematic parameters of a group {' or '.join(sorted(groups))} (HPA?)",
            device=device,
            remedy="Check that this is the controller of the site file, and its firmware.",
        )
    ordered = dict(sorted(parameters.items(), key=lambda entry: entry[1]))
    return Layout(ordered, channels, WATCHDOG in numbers)
