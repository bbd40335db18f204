"""Every size and offset of the published table; framing however TCP splits or joins."""

import random
import struct

import pytest

from drivers.emscon import wire
from drivers.emscon.codes import PacketType
from drivers.emscon.framing import Framer
from drivers.errors import ProtocolError

# name: code, size of the request, size of the answer
SIZES = {
    "ExitApplication": (0, 12, 16),
    "GetSystemStatus": (1, 12, 56),
    "GetTrackerStatus": (2, 12, 20),
    "SetUnits": (5, 32, 16),
    "GetUnits": (6, 12, 36),
    "Initialize": (7, 12, 16),
    "Park": (10, 12, 16),
    "SetStationOrientationParams": (12, 60, 16),
    "SetTransformationParams": (14, 68, 16),
    "SetEnvironmentParams": (20, 36, 16),
    "GetEnvironmentParams": (21, 12, 40),
    "SetRefractionParams": (22, 28, 16),
    "GetRefractionParams": (23, 12, 32),
    "SetMeasurementMode": (24, 16, 16),
    "SetCoordinateSystemType": (26, 16, 16),
    "SetStationaryModeParams": (28, 20, 16),
    "GetStationaryModeParams": (29, 12, 24),
    "SetContinuousTimeModeParams": (30, 28, 16),
    "SetReflector": (40, 16, 16),
    "GetReflector": (41, 12, 20),
    "GetReflectors": (42, 12, 100),
    "SetSearchParams": (43, 24, 16),
    "SetSystemSettings": (47, 48, 16),
    "GetSystemSettings": (48, 12, 52),
    "StartMeasurement": (49, 12, 16),
    "StopMeasurement": (52, 12, 16),
    "ChangeFace": (53, 12, 16),
    "GoBirdBath": (54, 12, 16),
    "GoPosition": (55, 40, 16),
    "GoPositionHVD": (56, 40, 16),
    "PositionRelativeHV": (57, 28, 16),
    "PointLaser": (58, 36, 16),
    "MoveHV": (60, 20, 16),
    "GoLastMeasuredPoint": (62, 12, 16),
    "FindReflector": (63, 20, 16),
    "LookForTarget": (65, 44, 32),
    "GetDirection": (66, 12, 32),
    "SetStatisticMode": (80, 20, 16),
    "CheckBirdBath": (87, 12, 64),
    "GoBirdBath2": (95, 16, 16),
    "GetFace": (98, 12, 20),
    "GetMeasurementStatusInfo": (122, 12, 24),
    "GetObjectTemperature": (127, 12, 24),
    "ClearCommandQueue": (130, 16, 16),
    "GetTrackerInfo": (132, 12, 164),
    "GoAndMeasure": (135, 36, 16),
    "GetMeteoStationInfo": (139, 12, 92),
}
OFFSETS = {
    (PacketType.SINGLE_RESULT, "mode"): 12,
    (PacketType.SINGLE_RESULT, "try_mode"): 16,
    (PacketType.SINGLE_RESULT, "val1"): 20,
    (PacketType.SINGLE_RESULT, "std1"): 44,
    (PacketType.SINGLE_RESULT, "pointing_h"): 76,
    (PacketType.SINGLE_RESULT, "apriori1"): 100,
    (PacketType.SINGLE_RESULT, "temperature"): 132,
    (PacketType.SINGLE_RESULT, "pressure"): 140,
    (PacketType.SINGLE_RESULT, "humidity"): 148,
    (PacketType.SINGLE_RESULT_2, "covar12"): 76,
    (PacketType.SINGLE_RESULT_2, "pointing_h"): 100,
    (PacketType.SINGLE_RESULT_2, "temperature"): 180,
    (PacketType.MULTI_RESULT, "count"): 12,
    (PacketType.MULTI_RESULT, "mode"): 16,
    (PacketType.MULTI_RESULT, "try_mode"): 20,
    (PacketType.MULTI_RESULT, "temperature"): 24,
}


@pytest.mark.parametrize("name", SIZES)
def test_sizes_and_codes_are_those_published(name: str) -> None:
    command = wire.COMMANDS[name]
    assert (command.code, command.request.size, command.answer.size) == SIZES[name]


@pytest.mark.parametrize(("kind", "name"), OFFSETS)
def test_offsets_in_data_packets_are_those_published(kind: PacketType, name: str) -> None:
    assert wire.DATA[kind].offset(name) == OFFSETS[kind, name]


def test_sizes_of_data_packets_are_those_published() -> None:
    assert wire.DATA[PacketType.SINGLE_RESULT].size == 156
    assert wire.DATA[PacketType.SINGLE_RESULT_2].size == 204
    assert wire.DATA[PacketType.REFLECTOR_POSITION].size == 36
    assert wire.DATA[PacketType.NIVEL_RESULT].size == 40
    assert wire.DATA[PacketType.MULTI_RESULT].size == 48
    assert wire.RECORD.size == 36
    assert len(wire.status_change(25)) == 12
    assert len(wire.error(64, 10004)) == 16


def test_reflector_answer_offsets() -> None:
    answer = wire.COMMANDS["GetReflectors"].answer
    names = ("total", "id", "target_type", "surface_offset", "name")
    assert [answer.offset(name) for name in names] == [16, 20, 24, 28, 36]


def _some(layout: wire.Layout, rng: random.Random) -> dict[str, wire.Value]:
    make = {
        "i": lambda: rng.randrange(-(2**31), 2**31),
        "d": lambda: rng.uniform(-1e6, 1e6),
        "s": lambda: "".join(rng.choices("AT901-LR äµ", k=rng.randrange(32))),
    }
    return {name: make[kind]() for name, kind in layout.fields}


@pytest.mark.parametrize("name", SIZES)
def test_packing_and_taking_apart_are_inverse(name: str) -> None:
    rng = random.Random(name)
    command = wire.COMMANDS[name]
    sent, said = _some(command.request, rng), _some(command.answer, rng)
    assert wire.parse_request(wire.request(name, **sent)).fields == sent
    assert wire.parse(wire.answer(name, 0, **said)).fields == said or not said


def test_framing_does_not_depend_on_how_tcp_cuts() -> None:
    rng = random.Random(5)
    packets = [wire.status_change(rng.randrange(1000)) for _ in range(50)]
    packets += [wire.answer("GetFace", 0, face=1), wire.error(64, 3), wire.request("Initialize")]
    rng.shuffle(packets)
    stream = b"".join(packets)
    for _ in range(50):
        framer, seen, rest = Framer(), [], stream
        while rest:
            cut = rng.randrange(1, 40)
            seen += framer.feed(rest[:cut])
            rest = rest[cut:]
        assert seen == packets
        assert framer.pending == 0


@pytest.mark.parametrize("size", [-1, 0, 7, 65537, 2**31 - 1])
def test_impossible_packet_sizes_are_refused(size: int) -> None:
    with pytest.raises(ProtocolError, match="claims to be"):
        Framer().feed(struct.pack("<ii", size, 0))


def test_short_packets_are_refused_not_misread() -> None:
    whole = wire.answer("GetSystemStatus", 0, **_some(wire.COMMANDS["GetSystemStatus"].answer,
                                                      random.Random(1)))  # fmt: skip
    for length in (8, 12, 15, 20, 55):
        with pytest.raises(ProtocolError):
            wire.parse(struct.pack("<i", length) + whole[4:length])


def test_multi_result_must_hold_the_records_that_it_claims() -> None:
    record = {"status": 0, "seconds": 1, "microseconds": 5, "val1": 1.0, "val2": 2.0, "val3": 3.0}
    packet = wire.multi_result([record] * 3, 1, 20.0, 1013.0, 50.0)
    assert len(packet) == 48 + 3 * 36
    assert list(wire.parse(packet).records) == [record] * 3
    with pytest.raises(ProtocolError, match="claims 3 records"):
        wire.parse(packet[:-1])


def test_a_refusal_may_come_without_its_data() -> None:
    assert wire.parse(wire.bare_answer(1, 39)).status == 39


def test_wrong_fields_are_not_sent() -> None:
    with pytest.raises(ValueError, match="belong"):
        wire.request("SetUnits", length=1)
    with pytest.raises(ValueError, match="kind i"):
        wire.request("SetReflector", id="CCR")
