"""The kind ``emscon`` of site files."""

from collections.abc import Mapping
from typing import Any

from drivers.emscon.codes import WeatherMonitor
from drivers.interface import Tracker
from drivers.kind import Kind, Setting, Surroundings

_WEATHER = {
    "compensate": WeatherMonitor.READ_AND_COMPUTE,
    "read": WeatherMonitor.READ,
    "off": WeatherMonitor.OFF,
}
_OBJECT_SENSOR = {"auto": None, "yes": True, "no": False}


async def _open(around: Surroundings) -> Tracker:
    from drivers.emscon.settings import EmsconSettings
    from drivers.emscon.tracker import EmsconTracker

    settings = around.settings
    environment = settings["environment"]
    own = EmsconSettings(
        weather_monitor=_WEATHER[settings["weather"]],
        environment=None if environment is None else tuple(environment),
        object_sensor=_OBJECT_SENSOR[settings["object_sensor"]],
        search_radius_mm=settings["search_radius_mm"],
        search_timeout_s=settings["search_timeout_s"],
        margin_s=settings["margin_s"],
    )
    return await EmsconTracker.connect(
        _address(settings), time_scale=around.time_scale, settings=own
    )


def _address(settings: Mapping[str, Any]) -> str:
    return str(settings["address"])


KIND: Kind[Tracker] = Kind(
    says="Laser trackers that speak the emScon TPI (AT901, AT40x and their kin) on TCP",
    settings=(
        Setting("address", "address", "host of its controller; host:port if not 700", port=700),
        Setting(
            "weather",
            "text",
            "its weather station: compensate refraction by it, only read it, or off (none)",
            "compensate",
            choices=tuple(_WEATHER),
        ),
        Setting(
            "environment",
            "numbers",
            "air by hand where there is no weather station: deg C, hPa, relative humidity in %",
            None,
            count=3,
        ),
        Setting(
            "object_sensor",
            "text",
            "whether a sensor of the object's temperature is connected; auto asks the tracker",
            "auto",
            choices=tuple(_OBJECT_SENSOR),
        ),
        Setting("search_radius_mm", "number", "radius of a search, mm", 20.0, least=0.1, most=1e3),
        Setting("search_timeout_s", "number", "length of a search, s", 20.0, least=0.1, most=600.0),
        Setting(
            "margin_s",
            "number",
            "seconds that an answer may take beyond the tracker's own time",
            3.0,
            least=0.1,
            most=60.0,
        ),
    ),
    open=_open,
    address=_address,
)
