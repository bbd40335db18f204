"""What devices may send, and the parsers that take it apart; seeds of each, and mutations.

A target takes bytes as they come from a wire. It may raise what a driver raises (DeviceError) and
nothing else; numbers that it lets through are finite.
"""

import contextlib
import math
import random
import struct
from collections.abc import Callable
from dataclasses import dataclass

import can
import canopen

from drivers.canopen.eds import dictionary, eds_path
from drivers.canopen.reader import FrameReader
from drivers.canopen.slcan_bus import SlcanBus
from drivers.emscon import wire
from drivers.emscon.codes import PacketType
from drivers.emscon.framing import Framer
from drivers.emscon.measurement import Measurement
from drivers.emscon.results import reading, samples
from drivers.errors import DeviceError
from drivers.gcs.answers import by_item, numbers, registers
from drivers.gcs.line import Line
from drivers.geocom.codes import Rpc
from drivers.geocom.link import GeoComLink
from drivers.lines.reading import PLAIN, LinePattern

NASTY = (
    b"", b"\x00" * 8, b"\xff" * 8, b"9" * 5000, b"-" * 40, b"1e999", b"nan", b"inf", b"\r", b"\n",
    b" \n", b"=", b",", b":", b"\x1b[2J", b"\xc2\xb2", b"%R1P,0,1:", b"0x", b"_", b"t18A8", b"\a",
)  # fmt: skip


@dataclass(frozen=True)
class Target:
    """A parser under test: whole packets to begin with, and what takes bytes apart."""

    name: str
    seeds: tuple[bytes, ...]
    take: Callable[[bytes], None]


class Wire:
    """A port that has bytes in it and answers nothing else."""

    def __init__(self, data: bytes) -> None:
        self.data, self.at = data, 0

    @property
    def in_waiting(self) -> int:
        return len(self.data) - self.at

    def read(self, size: int = 1, /) -> bytes:
        found = self.data[self.at : self.at + size]
        self.at += len(found)
        return found

    def write(self, data: bytes, /) -> int:
        return len(data)

    def reset_input_buffer(self) -> None:
        """Nothing that came before is kept."""

    def flush(self) -> None:
        """Nothing waits."""

    def close(self) -> None:
        """Nothing is held."""


def mutated(seed: bytes, dice: random.Random) -> bytes:
    """One to four things done to a packet."""
    data = bytearray(seed)
    for _ in range(dice.randint(1, 4)):
        at = dice.randint(0, len(data))
        how = dice.randrange(6)
        if how == 0 and at < len(data):
            data[at] ^= 1 << dice.randrange(8)
        elif how == 1 and at < len(data):
            data[at] = dice.randrange(256)
        elif how == 2:
            del data[at : at + dice.randint(1, 8)]
        elif how == 3:
            data[at:at] = dice.choice(NASTY)
        elif how == 4:
            data[at:at] = data[max(0, at - dice.randint(1, 30)) : at]
        else:
            del data[at:]
    return bytes(data)


def _finite(*values: float) -> None:
    if not all(map(math.isfinite, values)):
        raise AssertionError(f"let through: {values}")


def _emscon(data: bytes) -> None:
    framer, measurement = Framer(), Measurement("tracker")
    measurement.hear(wire.parse(wire.answer("StartMeasurement")))
    cut = data[0] % max(len(data), 1) if data else 0
    for chunk in (data[:cut], data[cut:]):
        for raw in framer.feed(chunk):
            packet = wire.parse(raw)
            measurement.hear(packet)
            if packet.type in (PacketType.SINGLE_RESULT, PacketType.SINGLE_RESULT_2):
                found = reading(packet, "tracker", weather=True)
                _finite(*found.xyz, *found.covariance)
            for sample in samples(packet, "tracker"):
                _finite(sample.time_s, *(sample.xyz if sample.valid else ()))


def _emscon_seeds() -> tuple[bytes, ...]:
    result = wire.DATA[PacketType.SINGLE_RESULT_2]
    values: dict[str, wire.Value] = {
        name: 1 if kind == "i" else 1000.5 for name, kind in result.fields
    }
    record = {"status": 0, "seconds": 1, "microseconds": 5, "val1": 1.0, "val2": 2.0, "val3": 3.0}
    name = {"total": 1, "id": 1, "target_type": 2, "surface_offset": 19.0, "name": "CCR-1.5in"}
    return (
        wire.data(PacketType.SINGLE_RESULT_2, **values),
        wire.multi_result([record, record], 1, 20.0, 1013.0, 50.0),
        wire.answer("GetReflectors", **name),
        wire.status_change(25) + wire.error(64, 10004),
    )


class _Bus:
    """python-can's reader over :class:`Wire`, as its notifier runs it, into a network with a node.

    The adapter is opened without a port: its constructor asks one.
    """

    def __init__(self) -> None:
        self.bus = SlcanBus.__new__(SlcanBus)
        super(SlcanBus, self.bus).__init__(channel="loop://", sleep_after_open=0)
        self.network = canopen.Network()
        self.reader = FrameReader(self.network, lambda count, what: None, lambda why: None)
        self.bus._on_damaged = self.reader.note
        node = canopen.RemoteNode(10, dictionary(eds_path("hexapod_controller"), 10))
        self.network.add_node(node)
        self.bus.serialPortOrig.close()
        self.bus._is_shutdown = True  # there is no port that could be told

    def take(self, data: bytes) -> None:
        port = Wire(data)
        self.bus._buffer.clear()
        self.bus.serialPortOrig = port
        while port.in_waiting > 0:
            try:
                message = self.bus.recv(0.0)
            except can.CanError:
                return
            if message is not None:
                self.reader.on_message_received(message)


_SLCAN = (
    b"t18A81122334455667788\r", b"t70A105\r", b"t58A84B60200011000000\r", b"T0000018A20102\r",
    b"t08A8108100000000000A\r", b"z\rV1013\r", b"r18A0\r",
)  # fmt: skip


def _gcs(data: bytes) -> None:
    line = Line(Wire(data), "controller")
    line.identity = "(c)2015 PI, C-887, 1001, 1.0"
    for ask in (_asked, _codes, _plain, Line._moving, Line._ready):
        line._port = Wire(data)
        line._rest, line._in_step = b"", True
        try:
            ask(line)
        except DeviceError:
            continue


def _asked(line: Line) -> None:
    lines = line._query("POS? X Y", 0.0)
    by_item(lines, "controller")
    _finite(*numbers(lines, ("X", "Y"), "controller"))


def _codes(line: Line) -> None:
    line._in_step = True
    registers(line._query("SRG? X 1", 0.0), ("X",), "controller")


def _plain(line: Line) -> None:
    line._bare("VER?", 0.0)


_GCS = (
    b"X=1.5 \nY=-2.5e-3\n0\n", b"X 1=0x9003\n0\n", b"5\n", b"7\n0\n(c)2015 PI, C-887, 1001, 1.0\n",
    b"\xb1\n", b"X=1.0 \nY=",
)  # fmt: skip


class _Ending(Wire):
    """A port that is gone once everything was read."""

    def read(self, size: int = 1, /) -> bytes:
        found = super().read(size)
        if not found:
            raise OSError("gone")
        return found


def _geocom(data: bytes) -> None:
    link = GeoComLink(_Ending(data), 0.0, "station")  # type: ignore[arg-type]
    link._number = 7
    with contextlib.suppress(OSError):
        answer = link._exchange("", Rpc.TMC_GET_SIMPLE_MEA, math.inf)
        _finite(*answer.numbers(3, "station"))


_GEOCOM = (
    b"%R1P,0,7:0,1.570796,1.5,2.25\r\n", b"%R1P,0,7:1285,0,0,0\r\n", b"%R1P,2,7:0\r\n",
    b'%R1P,0,7:0,"TS60"\r\n', b"\r\n%R1P,0,6:0\r\n%R1P,0,7:0,1,2,3\r\n",
)  # fmt: skip

_PLAIN = LinePattern(PLAIN, "mm", ".", "")
_OWN = LinePattern(
    r"X=(?P<x>[^;]+);Y=(?P<y>[^;]+);Z=(?P<z>[^;]+);S=(?P<sx>\S+) (?P<sy>\S+) (?P<sz>\S+)", "m", ",",
    "^#",
)  # fmt: skip


def _lines(data: bytes) -> None:
    for line in data.decode("latin-1").split("\n"):
        for pattern in (_PLAIN, _OWN):
            if len(line) > 4096 or pattern.ignores(line):
                continue
            found = pattern.read(line)
            if found is not None:
                _finite(*found.xyz, *(found.sigma or ()))


_LINES = (b"1.5 -2.5e3 3\n", b"1;2;3;on\n4,5,6\n", b"X=1,5;Y=2;Z=3;S=0,01 0,02 0,03\n", b"# head\n")


def targets() -> dict[str, Target]:
    """Every parser by its name."""
    found = (
        Target("emscon", _emscon_seeds(), _emscon),
        Target("slcan", _SLCAN, _Bus().take),
        Target("gcs", _GCS, _gcs),
        Target("geocom", _GEOCOM, _geocom),
        Target("lines", _LINES, _lines),
    )
    return {one.name: one for one in found}


def stream(target: Target, dice: random.Random) -> bytes:
    """Something that may come: a seed or two, spoilt; sizes of a packet are sometimes made true."""
    data = b"".join(dice.choices(target.seeds, k=dice.randint(1, 2)))
    data = mutated(data, dice)
    if target.name == "emscon" and len(data) >= 8 and dice.random() < 0.7:
        data = struct.pack("<i", len(data)) + data[4:]
    return data


def fault(target: Target, data: bytes) -> Exception | None:
    """What a target raises beside DeviceError."""
    try:
        target.take(data)
    except DeviceError:
        return None
    except Exception as error:
        return error
    return None
