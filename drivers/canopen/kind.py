"""The kind ``canopen`` of site files."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from drivers.interface import MotionController
from drivers.kind import Kind, Setting, Surroundings


async def _open(around: Surroundings) -> MotionController:
    from drivers.canopen.controller import (
        CanopenController,
    )  # slow to import: only when it is opened

    settings = around.settings
    return await CanopenController.connect(
        settings["interface"],
        settings["channel"],
        settings["bitrate"] or None,
        machine=around.machine,
        node_id=settings["node"],
        eds=Path(settings["eds"]) if settings["eds"] else None,
        serial=around.serial or None,
        limits={actuator.name: actuator.limits for actuator in around.actuators},
        heartbeat_s=settings["heartbeat_s"],
        silence_s=settings["silence_s"],
        options=settings["can"],
    )


def known_interface(name: str) -> str:
    """What is wrong with the name of an interface; empty if python-can has it."""
    import can

    known = sorted(can.VALID_INTERFACES)
    return (
        "" if name in known else f"python-can has no interface {name!r}; it has {', '.join(known)}"
    )


def _address(settings: Mapping[str, Any]) -> str:
    return str(settings["channel"])


KIND: Kind[MotionController] = Kind(
    says="A kinematic controller with its CiA 402 drives on CANopen, our object dictionary",
    settings=(
        Setting(
            "interface", "text", "any interface of python-can", "slcan", check=known_interface
        ),
        Setting("channel", "text", 'as the interface calls it: "can0", "socket://host:port", ...'),
        Setting("bitrate", "whole", "of the bus, bit/s; 0 where the adapter knows it", 0),
        Setting("can", "table", "further keywords of the interface, as python-can calls them", {}),
        Setting("node", "whole", "node of the controller", 10, least=1, most=127),
        Setting("eds", "file", "its EDS file; left out, the one that ships for the machine", ""),
        Setting("heartbeat_s", "number", "period of the heartbeats, s", 0.1, least=0.01, most=10.0),
        Setting(
            "silence_s", "number", "seconds without heartbeat after which a node is lost", 1.0,
            least=0.05, most=60.0,
        ),
    ),
    open=_open,
    address=_address,
)  # fmt: skip
