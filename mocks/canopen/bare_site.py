"""The ``[controller]`` table of a site file for a bare machine: what its builder would write."""

from typing import Any

from mocks.canopen.bare_drive import BACKWARDS
from mocks.canopen.bare_eds import bare_eds_path, gearing_of
from mocks.world import World


def bare_site(world: World, channel: str, serials: list[int]) -> dict[str, Any]:
    """Return the settings of the kind ``drives`` for the drives of a machine."""
    actuators, stroke = world.machine.actuators, world.stroke
    numbers = range(1, len(actuators) + 1)
    return {
        "kind": "drives",
        "interface": "slcan",
        "channel": channel,
        "serial": "-".join(map(str, serials)),
        "eds": str(bare_eds_path(world.unit)),
        "feed_unit": gearing_of(world.unit).unit,
        "sign": [-1.0 if number in BACKWARDS else 1.0 for number in numbers],
        "homing_method": [34.0 for _ in numbers],
        "speed": [stroke.speed for _ in numbers],
        "acceleration": [5.0 * stroke.speed for _ in numbers],
        "referenced": "0x6041 bit 14",
    }
