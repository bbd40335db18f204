"""Settings of the mock tracker: how it wakes up, what changes are announced, what it refuses."""

from collections.abc import Mapping

from drivers.emscon import wire
from drivers.emscon.codes import (
    Coordinates,
    Event,
    MeasurementMode,
    Status,
    TargetType,
    WeatherMonitor,
)

Values = Mapping[str, wire.Value]

REFLECTORS: dict[int, tuple[str, TargetType, float, float]] = {
    1: ("CCR-1.5in", TargetType.CORNER_CUBE, 19.05, 0.0),
    2: ("CCR-0.5in", TargetType.CORNER_CUBE, 6.35, 0.012),
    3: ("TBR-0.5in", TargetType.GLASS_PRISM, 6.35, 4.310),
}
"""Identifier -> name, kind, surface offset and range constant against the one in use, mm."""

DEFAULTS: dict[str, dict[str, wire.Value]] = {
    "Units": {"length": 0, "angle": 0, "temperature": 0, "pressure": 0, "humidity": 0},
    "StationOrientationParams": dict.fromkeys(("x", "y", "z", "rx", "ry", "rz"), 0.0),
    "TransformationParams": {
        **dict.fromkeys(("x", "y", "z", "rx", "ry", "rz"), 0.0),
        "scale": 1.0,
    },
    "EnvironmentParams": {"temperature": 20.0, "pressure": 1013.25, "humidity": 50.0},
    "RefractionParams": {"n_ifm": 1.00027, "n_adm": 1.00027},
    "MeasurementMode": {"mode": 0},
    "CoordinateSystemType": {"coordinates": 0},
    "StationaryModeParams": {"time_ms": 500, "use_adm": 1},
    "ContinuousTimeModeParams": {
        "separation_ms": 500, "points": 0, "use_region": 0, "region_type": 0,
    },
    "Reflector": {"id": 1},
    "SearchParams": {"radius": 0.02, "timeout_ms": 30000},
    "SystemSettings": {
        "weather_monitor": int(WeatherMonitor.READ), "apply_transformation": 0,
        "apply_orientation": 0, "keep_last_position": 1, "send_unsolicited": 1,
        "send_reflector_position": 0, "try_mode": 0, "has_nivel": 0, "has_video": 0,
    },
    "StatisticMode": {"stationary": 0, "continuous": 0},
}  # fmt: skip
CHANGED = {
    "Units": Event.UNITS_CHANGED,
    "EnvironmentParams": Event.ENVIRONMENT_CHANGED,
    "RefractionParams": Event.REFRACTION_CHANGED,
    "MeasurementMode": Event.MEAS_MODE_CHANGED,
    "CoordinateSystemType": Event.COORDINATE_TYPE_CHANGED,
    "StationaryModeParams": Event.STATIONARY_PARAMS_CHANGED,
    "Reflector": Event.REFLECTOR_CHANGED,
    "SystemSettings": Event.SETTINGS_CHANGED,
    "StatisticMode": Event.STATISTIC_MODE_CHANGED,
}
NEEDS_INITIALIZE = {
    "StartMeasurement", "ChangeFace", "GoBirdBath", "GoBirdBath2", "GoPosition", "GoPositionHVD",
    "FindReflector", "GoLastMeasuredPoint", "LookForTarget", "PointLaser",
}  # fmt: skip


def objection(kind: str, values: Values) -> Status:
    """Why a setting is not acceptable, or OK."""
    allowed = {
        "Reflector": ("id", tuple(REFLECTORS)),
        "CoordinateSystemType": (
            "coordinates", (Coordinates.RIGHT_HANDED, Coordinates.SPHERICAL_CCW)
        ),
        "MeasurementMode": (
            "mode", (MeasurementMode.STATIONARY, MeasurementMode.CONTINUOUS_TIME)
        ),
    }  # fmt: skip
    if kind in allowed and values[allowed[kind][0]] not in allowed[kind][1]:
        return Status.WRONG_PARAMETER
    if kind == "StationaryModeParams" and not 100 <= int(values["time_ms"]) <= 600_000:
        return Status.OUT_OF_RANGE_NOK
    if kind == "ContinuousTimeModeParams" and int(values["separation_ms"]) < 1:
        return Status.OUT_OF_RANGE_NOK
    return Status.OK
