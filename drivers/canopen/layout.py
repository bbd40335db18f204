"""What the controller's EDS says about where things are."""

import configparser
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from canopen import ObjectDictionary

from drivers.canopen.eds import dictionary
from drivers.errors import DeviceError

KINEMATIC, COMPENSATION = range(0x2100, 0x2200), range(0x2200, 0x2300)
IDENTITY, MACHINE, CHANNELS = 0x1018, 0x2000, 0x2300
POSE, COMMAND, COMMANDED_Q, SETPOINTS = 0x2400, 0x2401, 0x2402, 0x2403
STATUS, TARGET_Q, ACTUAL_Q, LOWER_Q, UPPER_Q = 0x2410, 0x2411, 0x2412, 0x2420, 0x2421
CHECKSUM, RELOAD, KINEMATIC_BLOCK, COMPENSATION_BLOCK = 0x2500, 0x2501, 0x2502, 0x2503
STORE, RESTORE = 0x1010, 0x1011
SAVE, LOAD = b"save", b"load"

Address = tuple[int, int]


@dataclass(frozen=True)
class Layout:
    """Names and addresses of one machine's controller.

    ``kinematic``, ``compensation`` and ``channels``: name -> (index, sub-index), in the order of
    the dictionary, which is that of the blocks and of the checksum. ``actuators``: q1, q2, ...
    """

    machine: str
    product_code: int
    kinematic: dict[str, Address]
    compensation: dict[str, Address]
    channels: dict[str, Address]
    actuators: tuple[str, ...]
    pose: tuple[str, ...]

    @property
    def parameters(self) -> dict[str, Address]:
        """Kinematic parameters, then compensation values."""
        return self.kinematic | self.compensation


def named_entries(od: ObjectDictionary, indices: range) -> dict[str, Address]:
    """Return name -> address of all entries of the arrays in ``indices``."""
    found: dict[str, Address] = {}
    for index in indices:
        if index in od:
            entry: Any = od[index]
            for sub in range(1, len(entry)):
                found[entry[sub].name] = (index, sub)
    return found


def read_layout(eds: Path, node_id: int) -> Layout:
    """Read a controller's EDS file; raises DeviceError for one that is something else."""
    try:
        return _layout(dictionary(eds, node_id))
    except (KeyError, ValueError, TypeError, AttributeError, configparser.Error, OSError) as error:
        raise DeviceError(
            f"is no EDS file of a kinematic controller ({type(error).__name__}: {error})",
            device=str(eds),
            remedy="Write it with pkmcal machine eds MACHINE; docs/protocols/canopen.md has its "
            "objects. Drives without such a controller are another kind (pkmcal site kinds).",
        ) from error


def _layout(od: Any) -> Layout:
    return Layout(
        machine=od[MACHINE][1].default,
        product_code=od[IDENTITY][2].default,
        kinematic=named_entries(od, KINEMATIC),
        compensation=named_entries(od, COMPENSATION),
        channels=named_entries(od, range(CHANNELS, CHANNELS + 1)),
        actuators=tuple(named_entries(od, range(TARGET_Q, TARGET_Q + 1))),
        pose=tuple(named_entries(od, range(POSE, POSE + 1))),
    )
