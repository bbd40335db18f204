"""Layout of every emScon packet that we use: one table, for the driver and for the mock.

Little-endian, no padding, whole-packet length first. Integers, enumerations and booleans are
int32 (``i``), reals are IEEE 754 doubles (``d``), names are 32 UTF-16 units (``s``).

=================  ==============================  ======================
packet             fixed part                      bytes before its fields
=================  ==============================  ======================
command            size, type 0, command           12
answer             size, type 0, command, status   16
error              size, type 1, command, status   16
status change      size, type 8, event             12
data               size, type, status              12
=================  ==============================  ======================
"""

import struct
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from drivers.emscon.codes import PacketType
from drivers.errors import ProtocolError

Value = int | float | str
HEADER_SIZE = 8
_FORMATS = {"i": "i", "d": "d", "s": "64s"}


@dataclass(frozen=True)
class Layout:
    """Fields that follow a packet's fixed part of ``before`` bytes: ``"name:kind name:kind"``."""

    before: int
    spec: str = ""

    @cached_property
    def fields(self) -> tuple[tuple[str, str], ...]:
        """(name, kind) of each field in order."""
        return tuple((item.split(":")[0], item.split(":")[1]) for item in self.spec.split())

    @cached_property
    def code(self) -> struct.Struct:
        """Binary form of the fields."""
        return struct.Struct("<" + "".join(_FORMATS[kind] for _, kind in self.fields))

    @property
    def size(self) -> int:
        """Size of the whole packet in bytes."""
        return self.before + self.code.size

    def offset(self, name: str) -> int:
        """Place of a field in the whole packet, bytes."""
        names = [n for n, _ in self.fields]
        kinds = [_FORMATS[k] for _, k in self.fields[: names.index(name)]]
        return self.before + struct.calcsize("<" + "".join(kinds))

    def pack(self, values: Mapping[str, Value]) -> bytes:
        """Binary form of named values; a missing or unknown name is an error."""
        names = [name for name, _ in self.fields]
        if set(names) != set(values):
            raise ValueError(f"fields {sorted(values)} where {sorted(names)} belong")
        raw: list[int | float | bytes] = []
        for name, kind in self.fields:
            value = values[name]
            raw.append(value.encode("utf-16-le")[:64] if isinstance(value, str) else value)
            if isinstance(value, str) != (kind == "s"):
                raise ValueError(f"field {name} is of kind {kind}, got {value!r}")
        return self.code.pack(*raw)

    def unpack(self, packet: bytes) -> dict[str, Value]:
        """Named values of a whole packet; raises ProtocolError if it is too short."""
        if len(packet) < self.size:
            raise ProtocolError(
                f"packet of {len(packet)} bytes where {self.size} belong",
                remedy="The tracker speaks another version of its protocol.",
            )
        values = self.code.unpack_from(packet, self.before)
        return {
            name: _text(value) if kind == "s" else value
            for (name, kind), value in zip(self.fields, values, strict=True)
        }


def _text(raw: bytes) -> str:
    return raw.decode("utf-16-le", errors="replace").split("\0", 1)[0]


@dataclass(frozen=True)
class Command:
    """A command: its code, the fields of its request and those of its answer."""

    name: str
    code: int
    request: Layout
    answer: Layout


_METEO = "temperature:d pressure:d humidity:d"
_POINT = "x:d y:d z:d"
_SETTINGS = (
    "weather_monitor:i apply_transformation:i apply_orientation:i keep_last_position:i "
    "send_unsolicited:i send_reflector_position:i try_mode:i has_nivel:i has_video:i"
)
_UNITS = "length:i angle:i temperature:i pressure:i humidity:i"
_STATIONARY = "time_ms:i use_adm:i"
_SIX = "x:d y:d z:d rx:d ry:d rz:d"

# name, code, fields of the request, fields of the answer
_TABLE: tuple[tuple[str, int, str, str], ...] = (
    ("ExitApplication", 0, "", ""),
    (
        "GetSystemStatus",
        1,
        "",
        "last_result:i processor:i laser:i adm:i major:i minor:i build:i weather_monitor:i "
        "flags:i serial:i",
    ),
    ("GetTrackerStatus", 2, "", "tracker_status:i"),
    ("SetUnits", 5, _UNITS, ""),
    ("GetUnits", 6, "", _UNITS),
    ("Initialize", 7, "", ""),
    ("Park", 10, "", ""),
    ("SetStationOrientationParams", 12, _SIX, ""),
    ("GetStationOrientationParams", 13, "", _SIX),
    ("SetTransformationParams", 14, _SIX + " scale:d", ""),
    ("GetTransformationParams", 15, "", _SIX + " scale:d"),
    ("SetEnvironmentParams", 20, _METEO, ""),
    ("GetEnvironmentParams", 21, "", _METEO),
    ("SetRefractionParams", 22, "n_ifm:d n_adm:d", ""),
    ("GetRefractionParams", 23, "", "n_ifm:d n_adm:d"),
    ("SetMeasurementMode", 24, "mode:i", ""),
    ("SetCoordinateSystemType", 26, "coordinates:i", ""),
    ("SetStationaryModeParams", 28, _STATIONARY, ""),
    ("GetStationaryModeParams", 29, "", _STATIONARY),
    (
        "SetContinuousTimeModeParams",
        30,
        "separation_ms:i points:i use_region:i region_type:i",
        "",
    ),
    ("SetReflector", 40, "id:i", ""),
    ("GetReflector", 41, "", "id:i"),
    ("GetReflectors", 42, "", "total:i id:i target_type:i surface_offset:d name:s"),
    ("SetSearchParams", 43, "radius:d timeout_ms:i", ""),
    ("SetSystemSettings", 47, _SETTINGS, ""),
    ("GetSystemSettings", 48, "", _SETTINGS),
    ("StartMeasurement", 49, "", ""),
    ("StopMeasurement", 52, "", ""),
    ("ChangeFace", 53, "", ""),
    ("GoBirdBath", 54, "", ""),
    ("GoPosition", 55, _POINT + " use_adm:i", ""),
    ("GoPositionHVD", 56, "hz:d v:d d:d use_adm:i", ""),
    ("PositionRelativeHV", 57, "hz:d v:d", ""),
    ("PointLaser", 58, _POINT, ""),
    ("MoveHV", 60, "hz_speed:i v_speed:i", ""),
    ("GoLastMeasuredPoint", 62, "", ""),
    ("FindReflector", 63, "distance:d", ""),
    ("LookForTarget", 65, _POINT + " radius:d", "hz:d v:d"),
    ("GetDirection", 66, "", "hz:d v:d"),
    ("SetStatisticMode", 80, "stationary:i continuous:i", ""),
    ("CheckBirdBath", 87, "", "hz:d v:d d:d d_hz:d d_v:d d_d:d"),
    ("GoBirdBath2", 95, "clockwise:i", ""),
    ("GetFace", 98, "", "face:i"),
    ("GetMeasurementStatusInfo", 122, "", "last_result:i bits:i"),
    ("GetObjectTemperature", 127, "", "temperature:d"),
    ("ClearCommandQueue", 130, "all:i", ""),
    (
        "GetTrackerInfo",
        132,
        "",
        "sensor_type:i name:s serial:i compensation:i has_adm:i has_camera:i has_nivel:i "
        "nivel_offset:d max_distance:d min_distance:d max_rate:i faces:i hz_range:d v_range:d "
        "accuracy_model:i major:i minor:i",
    ),
    ("GoAndMeasure", 135, _POINT, ""),
    ("GetMeteoStationInfo", 139, "", "station_type:i name:s major:i minor:i"),
)

COMMANDS: dict[str, Command] = {
    name: Command(name, code, Layout(12, request), Layout(16, answer))
    for name, code, request, answer in _TABLE
}
BY_CODE: dict[int, Command] = {command.code: command for command in COMMANDS.values()}

_STD = "std1:d std2:d std3:d std_total:d"
_APRIORI = "apriori1:d apriori2:d apriori3:d apriori_total:d"
_COVAR = "covar12:d covar13:d covar23:d"
_APRIORI_COVAR = "apriori_covar12:d apriori_covar13:d apriori_covar23:d"
_RESULT = "mode:i try_mode:i val1:d val2:d val3:d " + _STD
DATA: dict[int, Layout] = {
    PacketType.SINGLE_RESULT: Layout(
        12, f"{_RESULT} pointing_h:d pointing_v:d pointing_d:d {_APRIORI} {_METEO}"
    ),
    PacketType.SINGLE_RESULT_2: Layout(
        12,
        f"{_RESULT} {_COVAR} pointing_h:d pointing_v:d pointing_d:d {_APRIORI} {_APRIORI_COVAR} "
        f"{_METEO}",
    ),
    PacketType.MULTI_RESULT: Layout(12, f"count:i mode:i try_mode:i {_METEO}"),
    PacketType.NIVEL_RESULT: Layout(12, "nivel_status:i x_tilt:d y_tilt:d temperature:d"),
    PacketType.REFLECTOR_POSITION: Layout(12, _POINT),
}
RECORD = Layout(0, "status:i seconds:i microseconds:i val1:d val2:d val3:d")
_HEADER = struct.Struct("<ii")


@dataclass(frozen=True)
class Packet:
    """A packet taken apart; ``command`` and ``event`` are -1 where the type has none."""

    type: int
    command: int = -1
    status: int = 0
    event: int = -1
    fields: Mapping[str, Value] = field(default_factory=dict)
    records: Sequence[Mapping[str, Value]] = ()

    def real(self, name: str) -> float:
        """A real field."""
        return float(self.fields[name])

    def integer(self, name: str) -> int:
        """An integer field."""
        return int(self.fields[name])

    def text(self, name: str) -> str:
        """A text field."""
        return str(self.fields[name])


def _frame(kind: int, body: bytes) -> bytes:
    return _HEADER.pack(HEADER_SIZE + len(body), kind) + body


def request(name: str, /, **values: Value) -> bytes:
    """A command as the program sends it."""
    command = COMMANDS[name]
    return _frame(
        PacketType.COMMAND, struct.pack("<i", command.code) + command.request.pack(values)
    )


def answer(name: str, status: int = 0, /, **values: Value) -> bytes:
    """A tracker's answer to a command; without values it is the fixed part alone."""
    command = COMMANDS[name]
    body = struct.pack("<ii", command.code, status)
    return _frame(PacketType.COMMAND, body + (command.answer.pack(values) if values else b""))


def bare_answer(code: int, status: int) -> bytes:
    """A tracker's answer without data, to a command given by number."""
    return _frame(PacketType.COMMAND, struct.pack("<ii", code, status))


def error(code: int, status: int) -> bytes:
    """An error packet; ``code`` is the command that it names."""
    return _frame(PacketType.ERROR, struct.pack("<ii", code, status))


def status_change(event: int) -> bytes:
    """An event."""
    return _frame(PacketType.STATUS_CHANGE, struct.pack("<i", event))


def data(kind: int, status: int = 0, /, **values: Value) -> bytes:
    """A data packet of a fixed layout."""
    return _frame(kind, struct.pack("<i", status) + DATA[kind].pack(values))


def multi_result(
    records: Sequence[Mapping[str, Value]], mode: int, temperature: float, pressure: float,
    humidity: float,
) -> bytes:  # fmt: skip
    """A continuous-mode packet with its records."""
    head = DATA[PacketType.MULTI_RESULT].pack(
        {"count": len(records), "mode": mode, "try_mode": 0, "temperature": temperature,
         "pressure": pressure, "humidity": humidity}
    )  # fmt: skip
    body = struct.pack("<i", 0) + head + b"".join(RECORD.pack(record) for record in records)
    return _frame(PacketType.MULTI_RESULT, body)


def parse(packet: bytes) -> Packet:
    """Take a whole packet apart, as the program sees it; raises ProtocolError."""
    kind = _HEADER.unpack_from(packet)[1]
    if kind == PacketType.COMMAND:
        code, status = _words(packet, 2)
        known = BY_CODE.get(code)
        # An answer that says no may come without the data.
        whole = known is not None and (status == 0 or len(packet) >= known.answer.size)
        values = known.answer.unpack(packet) if known is not None and whole else {}
        return Packet(kind, code, status, fields=values)
    if kind == PacketType.ERROR:
        code, status = _words(packet, 2)
        return Packet(kind, code, status)
    if kind == PacketType.STATUS_CHANGE:
        return Packet(kind, event=_words(packet, 1)[0])
    status = _words(packet, 1)[0]
    layout = DATA.get(kind)
    if layout is None:
        return Packet(kind, status=status)
    values = layout.unpack(packet)
    records = _records(packet, layout.size, int(values["count"])) if "count" in values else ()
    return Packet(kind, status=status, fields=values, records=records)


def parse_request(packet: bytes) -> Packet:
    """Take a command apart, as the tracker sees it; raises ProtocolError for anything else."""
    kind = _HEADER.unpack_from(packet)[1]
    if kind != PacketType.COMMAND:
        raise ProtocolError(
            f"packet of type {kind} where a command belongs",
            remedy="Look at the program that sends it: a tracker hears commands only.",
        )
    code = _words(packet, 1)[0]
    known = BY_CODE.get(code)
    return Packet(kind, code, fields=known.request.unpack(packet) if known is not None else {})


def _words(packet: bytes, count: int) -> tuple[int, ...]:
    if len(packet) < HEADER_SIZE + 4 * count:
        raise ProtocolError(
            f"packet of {len(packet)} bytes is shorter than its type allows",
            remedy="The tracker speaks another version of its protocol.",
        )
    return struct.unpack_from(f"<{count}i", packet, HEADER_SIZE)


def _records(packet: bytes, start: int, count: int) -> list[dict[str, Value]]:
    size = RECORD.size
    if count < 0 or len(packet) < start + count * size:
        raise ProtocolError(
            f"continuous packet of {len(packet)} bytes claims {count} records",
            remedy="The tracker speaks another version of its protocol.",
        )
    return [RECORD.unpack(packet[start + i * size : start + (i + 1) * size]) for i in range(count)]
