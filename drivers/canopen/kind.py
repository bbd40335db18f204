"""The kind ``canopen`` of site files."""

from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import TYPE_CHECKING, Any

from drivers.errors import Refused
from drivers.interface import MotionController
from drivers.kind import Kind, Setting, Surroundings

if TYPE_CHECKING:
    from drivers.canopen.layout import Layout


async def _open(around: Surroundings) -> MotionController:
    # Slow to import: only when it is opened.
    from drivers.canopen.controller import CanopenController
    from drivers.canopen.eds import eds_path
    from drivers.canopen.layout import read_layout

    settings = around.settings
    eds = Path(settings["eds"]) if settings["eds"] else eds_path(f"{around.machine}_controller")
    nodes = list(settings["drive_nodes"]) or range(1, len(around.actuators) + 1)
    _must_differ(nodes, settings["node"])
    _must_be_of(read_layout(eds, settings["node"]), eds, around)
    return await CanopenController.connect(
        settings["interface"],
        settings["channel"],
        settings["bitrate"] or None,
        machine=around.machine,
        node_id=settings["node"],
        eds=eds,
        serial=around.serial or None,
        limits={actuator.name: actuator.limits for actuator in around.actuators},
        heartbeat_s=settings["heartbeat_s"],
        silence_s=settings["silence_s"],
        options=settings["can"],
        drive_nodes=[int(node) for node in nodes],
        drive_eds=[Path(path) for path in settings["drive_eds"]],
    )


def _must_be_of(layout: "Layout", eds: Path, around: Surroundings) -> None:
    """Refuse an EDS file that was written for another machine, or for an older file of it."""
    named = (
        ("machine", [layout.machine], [around.machine]),
        ("actuators", list(layout.actuators), [a.name for a in around.actuators]),
        ("parameters", list(layout.kinematic), list(around.parameters)),
    )
    for what, there, wanted in named:
        if there != wanted:
            odd = [name for name in there if name not in wanted] or there
            lacks = [name for name in wanted if name not in there] or wanted
            raise Refused(
                f"its {what} are not those of the machine file: it has {_few(odd)}, "
                f"the machine file {_few(lacks)}",
                device=str(eds),
                remedy="Name another EDS file in [controller], or write it anew with pkmcal "
                "machine eds MACHINE (and set up the controller by it).",
            )


def _few(names: list[str]) -> str:
    return ", ".join(names[:3]) + (" ..." if len(names) > 3 else "")


def known_interface(name: str) -> str:
    """What is wrong with the name of an interface; empty if python-can has it."""
    import can

    known = sorted(can.VALID_INTERFACES)
    if name in known:
        return ""
    near = get_close_matches(name, known, 1)
    meant = f"Did you mean {near[0]!r}? It" if near else "It"
    return f"python-can has no interface {name!r}. {meant} has {', '.join(known)}"


def different_nodes(values: Any) -> str:
    """What is wrong with the node numbers of drives; empty if nothing is."""
    whole = all(value == int(value) and 1 <= value <= 126 for value in values)
    if not whole or len(set(values)) < len(values):
        return f"nodes are {list(values)}: different whole numbers from 1 to 126 are wanted"
    return ""


def _must_differ(nodes: Sequence[float], controller: int) -> None:
    """Refuse a drive at the node of the controller."""
    if controller in nodes:
        raise Refused(
            f"node {controller} is the controller and a drive at once",
            device="site file",
            remedy="Correct node or drive_nodes in [controller]",
        )


def _address(settings: Mapping[str, Any]) -> str:
    return str(settings["channel"])


BUS_SETTINGS = (
    Setting(
        "interface", "text", "any interface of python-can", "slcan", check=known_interface
    ),
    Setting("channel", "text", 'as the interface calls it: "can0", "socket://host:port", ...'),
    Setting("bitrate", "whole", "of the bus, bit/s; 0 where the adapter knows it", 0),
    Setting("can", "table", "further keywords of the interface, as python-can calls them", {}),
)  # fmt: skip
"""Any CAN interface, as python-can calls it."""

HEARTBEAT_SETTINGS = (
    Setting("heartbeat_s", "number", "period of the heartbeats, s", 0.1, least=0.01, most=10.0),
    Setting(
        "silence_s", "number", "seconds without heartbeat after which a node is lost", 1.0,
        least=0.05, most=60.0,
    ),
)  # fmt: skip
"""How nodes watch one another."""

KIND: Kind[MotionController] = Kind(
    says="A kinematic controller with its CiA 402 drives on CANopen, our object dictionary",
    settings=(
        *BUS_SETTINGS,
        Setting("node", "whole", "node of the controller", 10, least=1, most=127),
        Setting(
            "drive_nodes", "numbers", "nodes of its drives; left out, 1, 2, ...", (),
            count="actuators", check=different_nodes,
        ),
        Setting(
            "drive_eds", "files", "EDS file of its drives, one for all or one for each actuator; "
            "left out, the one that ships", (), count="actuators",
        ),
        Setting("eds", "file", "its EDS file; left out, the one that ships for the machine", ""),
        *HEARTBEAT_SETTINGS,
    ),
    open=_open,
    address=_address,
)  # fmt: skip
