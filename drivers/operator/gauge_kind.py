"""The kind ``operator`` of gauges in site files."""

from collections.abc import Mapping
from typing import Any

from drivers.interface import Gauge
from drivers.kind import Kind, Setting, Surroundings
from drivers.lines.number import UNITS
from drivers.operator.gauge import PersonReads


async def _open(around: Surroundings) -> Gauge:
    settings = around.settings
    return PersonReads(settings["unit"], settings["decimal"], settings["name"])


def _address(settings: Mapping[str, Any]) -> str:
    return f"{settings['name']}, typed in"


KIND: Kind[Gauge] = Kind(
    says="A gauge without a link: a person reads it off and types the number",
    settings=(
        Setting("unit", "text", "in which it is typed", "mm", choices=tuple(UNITS)),
        Setting("decimal", "text", "sign before decimals", ".", choices=(".", ",")),
        Setting("name", "text", "which gauge it is, in words", "gauge"),
    ),
    open=_open,
    address=_address,
)
