"""PI's own start-up and waiting functions, where somebody has installed them, on a closed hexapod.

PIPython is under a licence of its own and no dependency of this project: pip install PIPython.
"""

import gc
import sys
from collections.abc import Iterator

import pytest
from gcs_bench import running
from hexapod_bench import SixLegs

from mocks.gcs.server import GcsStation

pipython = pytest.importorskip("pipython", exc_type=ImportError)
pitools = pytest.importorskip("pipython.pitools", exc_type=ImportError)
interfaces = pytest.importorskip("pipython.pidevice.interfaces.pisocket", exc_type=ImportError)
# Its devices close twice when they are collected (its issue 8).
pytestmark = pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")


@pytest.fixture(autouse=True)
def _collected() -> Iterator[None]:
    """Its devices end in endless recursion when they are collected: here, not in a compilation."""
    yield
    gc.collect()


@pytest.fixture
def station() -> Iterator[GcsStation]:
    with running(GcsStation(SixLegs(), pose=True)) as running_station:
        yield running_station


def socket_gateway(station: GcsStation):
    return interfaces.PISocket(*station.address)


def serial_gateway(station: GcsStation):
    if sys.platform == "win32":
        pytest.skip("no pseudo terminals")
    module = pytest.importorskip("pipython.pidevice.interfaces.piserial", exc_type=ImportError)
    return module.PISerial(station.pty_path, 115200)


@pytest.mark.parametrize("gateway", [socket_gateway, serial_gateway])
def test_its_start_up_references_the_mock_and_moves_it(station: GcsStation, gateway) -> None:
    with pipython.GCSDevice(gateway=gateway(station)) as device:
        pitools.waitonready(device, polldelay=0.01)
        assert device.axes == list("XYZUVW")
        assert {"MOV", "qVMO", "qSPI", "KEN", "IsMoving", "StopAll"} <= set(device.funcs)
        assert not device.HasqSRG()
        pitools.startup(device, stages=None, refmodes="FRF")
        assert all(device.qFRF().values())
        assert all(device.qSVO().values())
        assert device.qPUN("U")["U"] == "DEG"

        assert device.qVMO({"X": 5.0, "U": 3.0})
        assert not device.qVMO({"Z": 500.0})
        pitools.moveandwait(device, {"X": 5.0, "Y": -4.0, "U": 3.0, "W": -2.0})
        place = device.qPOS()
        assert place["X"] == pytest.approx(5.0, abs=1e-6)
        assert place["U"] == pytest.approx(3.0, abs=1e-6)
        with pytest.raises(pipython.GCSError) as outside:
            device.MOV("Z", 500.0)
        assert outside.value.val == 7

        device.SPI({"R": 1.0, "S": 0.0, "T": 40.0})
        assert device.qSPI("T")["T"] == 40.0
        device.KSD("LAB", ["X", "W"], [1.0, 2.0])
        device.KEN("LAB")
        assert device.qKEN() == {"LAB": "KSD"}
        device.VLS(12.5)
        assert device.qVLS() == 12.5
        with pytest.raises(pipython.GCSError) as stopped:
            device.StopAll()
        assert stopped.value.val == 10
