"""What is not the same for every tracker of this kind."""

from dataclasses import dataclass

from drivers.emscon.codes import WeatherMonitor


@dataclass(frozen=True)
class EmsconSettings:
    """What is not the same in every laboratory.

    ``weather_monitor`` READ_AND_COMPUTE lets the tracker compensate refraction by its own weather
    station; with OFF it uses the last ``environment`` (deg C, hPa, relative humidity in %).
    ``object_sensor``: whether there is a sensor of the object's temperature; None to find out.
    """

    weather_monitor: WeatherMonitor = WeatherMonitor.READ_AND_COMPUTE
    environment: tuple[float, float, float] | None = None
    object_sensor: bool | None = None
    search_radius_mm: float = 20.0
    search_timeout_s: float = 20.0
    margin_s: float = 3.0
    """Wall seconds that an answer may take beyond the device's own time."""
