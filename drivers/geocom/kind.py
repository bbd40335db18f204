"""The kind ``geocom`` of site files."""

import math
from collections.abc import Mapping
from typing import Any

from drivers.interface import Tracker
from drivers.kind import Kind, Setting, Surroundings

ARCSEC = math.pi / 180.0 / 3600.0


async def _open(around: Surroundings) -> Tracker:
    from drivers.geocom.total_station import StationSettings, TotalStation

    settings = around.settings
    own = StationSettings(
        sigma_angle=ARCSEC * settings["sigma_arcsec"],
        sigma_distance_mm=settings["sigma_distance_mm"],
        ppm=settings["ppm"],
        search_mm=settings["search_radius_mm"],
    )
    return await TotalStation.connect(
        settings["port"], settings["baud"], settings["margin_s"], own, around.time_scale
    )


def _address(settings: Mapping[str, Any]) -> str:
    return str(settings["port"])


KIND: Kind[Tracker] = Kind(
    says="Leica total stations with motors and target recognition that speak GeoCOM",
    settings=(
        Setting("port", "text", "serial port, or socket://host:port"),
        Setting("baud", "whole", "of a serial port", 115_200, least=1200, most=921_600),
        Setting(
            "sigma_arcsec", "number", "standard uncertainty of a direction, arcsec", least=1e-3
        ),
        Setting(
            "sigma_distance_mm", "number", "standard uncertainty of a distance, mm", least=1e-4
        ),
        Setting("ppm", "number", "and so much of the distance, um/m", 0.0, least=0.0),
        Setting("search_radius_mm", "number", "radius of a search, mm", 50.0, least=1.0, most=1e4),
        Setting(
            "margin_s",
            "number",
            "seconds that an answer may take beyond the instrument's own time",
            3.0,
            least=0.1,
            most=60.0,
        ),
    ),
    open=_open,
    address=_address,
)
