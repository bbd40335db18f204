"""What devices may send, spoilt: taken apart or refused; a slice of the bench."""

import random

import pytest

import drivers.gcs.line
from bench._fuzz_packets import Target, fault, stream, targets
from drivers import plausible
from drivers.canopen.slcan_bus import is_whole
from drivers.emscon import wire
from drivers.emscon.codes import PacketType
from drivers.emscon.results import reading, samples
from drivers.errors import ProtocolError
from drivers.geocom.total_station import _point
from drivers.lines.reading import PLAIN, LinePattern

TARGETS = targets()


@pytest.mark.parametrize("target", TARGETS.values(), ids=TARGETS)
def test_packets_that_are_spoilt(target: Target, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(drivers.gcs.line, "ANSWER_S", 0.0)
    assert [fault(target, seed) for seed in target.seeds] == [None] * len(target.seeds)
    dice = random.Random(target.name)
    found = [fault(target, stream(target, dice)) for _ in range(1500)]
    assert [error for error in found if error is not None] == []


def result(**changed: float) -> wire.Packet:
    values: dict[str, wire.Value] = {
        name: 1 if kind == "i" else 0.01
        for name, kind in wire.DATA[PacketType.SINGLE_RESULT_2].fields
    }
    values |= {"temperature": 20.0, "pressure": 1013.0, "humidity": 50.0}
    values |= {f"apriori_covar{pair}": 0.0 for pair in ("12", "13", "23")}
    return wire.parse(wire.data(PacketType.SINGLE_RESULT_2, **{**values, **changed}))


@pytest.mark.parametrize(
    "changed",
    [
        {"val1": 1e300}, {"val2": float("nan")}, {"val3": -2e6}, {"apriori1": 1e200},
        {"apriori2": 1e-300}, {"apriori_covar12": 1.0}, {"temperature": 1e9}, {"humidity": -5.0},
        {"pressure": float("inf")},
    ],
    ids=lambda changed: next(iter(changed)),
)  # fmt: skip
def test_a_reading_that_cannot_be_is_no_reading(changed: dict[str, float]) -> None:
    reading(result(), "tracker", weather=True)
    with pytest.raises(ProtocolError, match="cannot be") as wrong:
        reading(result(**changed), "tracker", weather=True)
    assert wrong.value.remedy


def test_samples_that_cannot_be_are_refused_unless_they_are_marked_as_none() -> None:
    def packet(status: int) -> wire.Packet:
        place = {"val1": float("nan"), "val2": 0.0, "val3": 0.0}
        record = {"status": status, "seconds": 1, "microseconds": 0, **place}
        return wire.parse(wire.multi_result([record], 1, 20.0, 1013.0, 50.0))

    assert [sample.valid for sample in samples(packet(1), "tracker")] == [False]
    with pytest.raises(ProtocolError, match="cannot be"):
        list(samples(packet(0), "tracker"))


@pytest.mark.parametrize("values", [(1.0, 1.5, 0.0), (1.0, 1.5, 1e9), (1e9, 1.5, 2.0)])
def test_a_total_station_that_sends_what_cannot_be(values: tuple[float, float, float]) -> None:
    with pytest.raises(ProtocolError, match="cannot be"):
        _point("station", *values)


def test_a_line_of_thousands_of_digits_takes_no_time() -> None:
    pattern = LinePattern(PLAIN, "mm", ".", "")
    assert pattern.read("9" * 4000 + " 1 2") is None
    assert pattern.read("1" + " " * 4000 + "2 x") is None
    assert pattern.read(f"{plausible.SURVEYED_MM * 2} 1 2") is None
    assert pattern.read("1, 2 ;3 mm").xyz == (1.0, 2.0, 3.0)


def test_a_bell_within_a_frame_is_no_frame() -> None:
    assert not is_whole("t18A8\a")
    bus = TARGETS["slcan"]
    assert fault(bus, b"t58A84B602000\a1100\rt70\a105\r") is None
