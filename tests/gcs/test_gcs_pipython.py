"""PI's own Python client, where somebody has installed it, drives the mock.

It is under a licence of its own and no dependency of this project: pip install PIPython.
"""

import gc
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
from gcs_bench import SmallMachine, running

from mocks.gcs.server import GcsStation

pipython = pytest.importorskip("pipython", exc_type=ImportError)
interfaces = pytest.importorskip("pipython.pidevice.interfaces.pisocket", exc_type=ImportError)
# Its devices close twice when they are collected (its issue 8).
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
L0, H, THETA, CRC = 0x7F010001, 0x7F010002, 0x7F010003, 0x7F030001


@pytest.fixture(autouse=True)
def _collected() -> Iterator[None]:
    """Its devices end in endless recursion when they are collected: here, not in a compilation."""
    yield
    gc.collect()


@pytest.fixture
def station(tmp_path: Path) -> Iterator[GcsStation]:
    with running(GcsStation(SmallMachine(), tmp_path / "nvm.json")) as running_station:
        yield running_station


def socket_gateway(station: GcsStation):
    return interfaces.PISocket(*station.address)


def serial_gateway(station: GcsStation):
    if sys.platform == "win32":
        pytest.skip("no pseudo terminals")
    module = pytest.importorskip("pipython.pidevice.interfaces.piserial")
    return module.PISerial(station.pty_path, 115200)


def wait_until(true) -> None:
    pause = threading.Event()
    for _ in range(1000):
        if true():
            return
        pause.wait(0.005)
    raise AssertionError("never happened")


@pytest.mark.parametrize("gateway", [socket_gateway, serial_gateway])
def test_its_client_moves_writes_and_stores(station: GcsStation, gateway):
    with pipython.GCSDevice(gateway=gateway(station)) as device:
        move_write_store(device)


def move_write_store(device) -> None:
    assert "pkmcal mock" in device.qIDN()
    assert device.axes == list("XYZABC")
    device.SVO(dict.fromkeys("ABC", 1))
    device.MOV({"X": 10.0, "Y": -20.0, "Z": -150.0})
    wait_until(lambda: all(device.qONT().values()))
    assert device.qPOS("Z")["Z"] == pytest.approx(-150.0, abs=1e-9)
    assert not any(device.IsMoving().values())
    assert device.IsControllerReady()
    assert device.qTMX("A")["A"] == 430.0
    device.VEL("A", 12.5)
    assert device.qVEL("A")["A"] == 12.5
    with pytest.raises(pipython.GCSError) as under_power:
        device.SPA("1", L0, 410.5)
    assert under_power.value.val in (60, 95)
    device.SVO(dict.fromkeys("ABC", 0))
    assert device.qSRG("A", 1)["A"][1] in (0, "0x0")
    assert {"0x7F010001", "0x7F030003"} <= {x.split("=")[0] for x in device.qHPA().splitlines()}
    device.CCL(1, "advanced")
    device.SPA("1", L0, 410.123456789)
    assert device.qSPA("1", L0)["1"][L0] == 410.123456789
    assert device.qSEP("1", L0)["1"][L0] == 410.0
    crc = device.qSPA("1", CRC)["1"][CRC]
    device.WPA("100")
    device.SPA("1", L0, 409.0)
    device.RPA()
    assert device.qSPA("1", L0)["1"][L0] == 410.123456789
    assert device.qSPA("1", CRC)["1"][CRC] == crc
    device.SVO("A", 1)
    device.FRF("A")
    wait_until(device.IsControllerReady)
    assert device.qFRF("A")["A"]
    with pytest.raises(pipython.GCSError) as stopped:
        device.StopAll()
    assert stopped.value.val == 10
    device.timeout = 300
    with pytest.raises(pipython.GCSError) as unknown:
        device.qSPA("1", 0x3)
    assert unknown.value.val in (54, -7)
