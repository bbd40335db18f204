"""The kind ``operator`` of site files."""

from collections.abc import Mapping
from typing import Any

from drivers.interface import Motors
from drivers.kind import Kind, Setting, Surroundings
from drivers.operator.motors import NEAR, PersonMoves


async def _open(around: Surroundings) -> Motors:
    return PersonMoves(around.actuators, around.serial, around.settings["near"])


def _address(settings: Mapping[str, Any]) -> str:
    return str(settings["where"])


KIND: Kind[Motors] = Kind(
    says="A machine without a link: the program shows the actuator values, a person sets them",
    settings=(
        Setting("where", "text", "which machine it is, in words; shown, and locks it", "here"),
        Setting(
            "near", "number", "part of each range by which values that are typed may differ from "
            "those asked for", NEAR, least=0.0, most=1.0,
        ),
    ),
    open=_open,
    address=_address,
    takes="actuators",
)  # fmt: skip
