"""Numbers of the emScon TPI: packet types, statuses, events, states and units."""

from enum import IntEnum


class PacketType(IntEnum):
    """Second word of every packet."""

    COMMAND = 0
    ERROR = 1
    SINGLE_RESULT = 2
    MULTI_RESULT = 3
    NIVEL_RESULT = 6
    REFLECTOR_POSITION = 7
    STATUS_CHANGE = 8
    SINGLE_RESULT_2 = 9
    MULTI_RESULT_2 = 10


class Status(IntEnum):
    """Result status of an answer, an error or a data packet."""

    OK = 0
    SERVER_BUSY = 1
    NOT_IMPLEMENTED = 2
    WRONG_PARAMETER = 3
    OUT_OF_RANGE_OK = 11
    OUT_OF_RANGE_NOK = 12
    WRONG_REFLECTOR = 23
    NO_TARGET_FOUND = 26
    NO_WEATHER_MONITOR = 27
    NO_LAST_POINT = 28
    NO_ADM = 30
    USAGE_CONFLICT = 35
    NO_DISTANCE_SET = 37
    NOT_INITIALIZED = 39
    METEO_OUT_OF_RANGE = 57
    INTERNAL_PROCESS_ACTIVE = 59
    INVALID_INPUT = 98
    MEAS_STATUS_NOT_READY = 10004
    NO_STATIONARY_RESULT = 10009
    MULTI_CONNECTION = 10011
    NOT_WARMED_UP = 10012
    NOT_STABLE = 10013


class Event(IntEnum):
    """What a status-change packet reports."""

    DISTANCE_SET = 0
    LASER_WARMED_UP = 1
    ENVIRONMENT_CHANGED = 2
    REFRACTION_CHANGED = 3
    UNITS_CHANGED = 6
    REFLECTOR_CHANGED = 7
    SETTINGS_CHANGED = 8
    COORDINATE_TYPE_CHANGED = 12
    MEAS_MODE_CHANGED = 17
    STATIONARY_PARAMS_CHANGED = 18
    STATISTIC_MODE_CHANGED = 24
    NOT_READY = 25
    BUSY = 26
    READY = 27
    COUNT_REACHED = 28
    FACE_1 = 30
    FACE_2 = 31
    INIT_STATUS_CHANGED = 151
    SENSOR_DETECTED = 850
    SENSOR_DISCONNECTED = 851
    PROCESSOR_CLOSING = 997
    SERVER_CLOSING = 998
    SERVER_STARTED = 999


class TrackerStatus(IntEnum):
    """Answer of GetTrackerStatus."""

    NOT_READY = 0
    BUSY = 1
    READY = 2


class ProcessorStatus(IntEnum):
    """State of the tracker processor in GetSystemStatus."""

    BOOTED = 3
    COMPENSATED = 4
    INITIALIZED = 5


class LaserStatus(IntEnum):
    """State of the laser in GetSystemStatus."""

    HEATING = 2
    READY = 3


class MeasurementMode(IntEnum):
    """What StartMeasurement starts."""

    STATIONARY = 0
    CONTINUOUS_TIME = 1


class WeatherMonitor(IntEnum):
    """What the tracker does with its weather station."""

    OFF = 0
    READ = 1
    READ_AND_COMPUTE = 2


class Length(IntEnum):
    """Length unit."""

    METRE = 0
    MILLIMETRE = 1
    MICROMETRE = 2


class Angle(IntEnum):
    """Angle unit."""

    RADIAN = 0
    DEGREE = 1
    GON = 2


class Temperature(IntEnum):
    """Temperature unit."""

    CELSIUS = 0
    FAHRENHEIT = 1


class Pressure(IntEnum):
    """Pressure unit."""

    MBAR = 0
    HPA = 1
    KPA = 2


class Coordinates(IntEnum):
    """Coordinate system type."""

    RIGHT_HANDED = 0
    SPHERICAL_CCW = 7


class TargetType(IntEnum):
    """Kind of reflector."""

    CORNER_CUBE = 1
    CATS_EYE = 2
    GLASS_PRISM = 3
    REFLECTOR_FOR_INTERFEROMETER = 4


class SensorType(IntEnum):
    """Tracker model, as far as published."""

    AT901_B = 13
    AT901_MR = 14
    AT901_LR = 15
    AT401 = 70


UNKNOWN_COMMAND = 64
"""Command number in errors that belong to no command."""

STATUS_WORDS: dict[int, str] = {
    Status.SERVER_BUSY: "the tracker server is busy",
    Status.NOT_IMPLEMENTED: "not implemented by this tracker",
    Status.WRONG_PARAMETER: "a parameter is wrong",
    Status.OUT_OF_RANGE_NOK: "a value is out of range",
    Status.WRONG_REFLECTOR: "the reflector in the beam is not the one selected",
    Status.NO_TARGET_FOUND: "no reflector found there",
    Status.NO_WEATHER_MONITOR: "no weather station connected",
    Status.NO_LAST_POINT: "nothing was measured yet",
    Status.NO_ADM: "no absolute distance meter",
    Status.USAGE_CONFLICT: "not possible in the present mode",
    Status.NO_DISTANCE_SET: "the distance is not set: no reflector is locked",
    Status.NOT_INITIALIZED: "the tracker is not initialised",
    Status.METEO_OUT_OF_RANGE: "weather values out of range",
    Status.INTERNAL_PROCESS_ACTIVE: "the tracker is busy with a process of its own",
    Status.INVALID_INPUT: "invalid input",
    Status.MEAS_STATUS_NOT_READY: "not ready to measure: no reflector is locked",
    Status.NO_STATIONARY_RESULT: "the target did not stand still: no stationary result",
    Status.MULTI_CONNECTION: "another program is connected to the tracker",
    Status.NOT_WARMED_UP: "the laser is not warmed up",
    Status.NOT_STABLE: "the sensor is not stable",
}


def status_words(status: int) -> str:
    """A status in words, with its number."""
    return f"{STATUS_WORDS.get(status, 'a status that is not published')} (status {status})"
