"""The mock's GeoCOM judged by a foreign client (geocompy), and the driver beside it.

The station is a process of its own: the whole way is on the wire.
"""

import asyncio
import json
import math
import subprocess
from collections.abc import Iterator

import numpy as np
import pytest
from geocompy.communication import open_socket
from geocompy.geo import GeoCom
from geocompy.geo.gctypes import GeoComCode

from app.again import command_of
from calib.mechanism.rigid import from_euler
from drivers.geocom import codes
from drivers.geocom.kind import ARCSEC, KIND
from drivers.interface import Tracker
from drivers.kind import Surroundings

SCALE = 100.0


@pytest.fixture(scope="module")
def site() -> Iterator[dict]:
    words = ["mock", "hexapod", "--geocom", "--smrs", "3", "--scale", str(int(SCALE)), "--json"]
    command = command_of(*words, "--until-stdin-closes")
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as mock:
        assert mock.stdin is not None
        assert mock.stdout is not None
        yield json.loads(mock.stdout.readline())["site"]
        mock.stdin.close()
        mock.wait(20)


async def connected(site: dict) -> Tracker:
    told = site["tracker"]
    settings = {one.name: told.get(one.name, one.default) for one in KIND.settings}
    return await KIND.open(Surroundings(settings, "", "hexapod", (), {}, SCALE))


def near(site: dict) -> tuple[float, float, float]:
    """About where nest 3 of the platform at home is, tracker frame, by the site's rough frame."""
    frame = np.array(site["tracker"]["frame"])
    nest = np.add(site["nests"]["platform"]["3"], [0.0, 0.0, 220.0])
    x, y, z = from_euler(*frame[3:]) @ nest + frame[:3]
    return float(x), float(y), float(z)


def judged(port: str, aim: tuple[float, float]) -> dict[str, object]:
    """What the foreign client is told."""
    host, _, number = port.removeprefix("socket://").rpartition(":")
    with open_socket(host, int(number), "tcp", timeout=10) as connection:
        station = GeoCom(connection)
        found: dict[str, object] = {"name": station.csv.get_instrument_name().params}
        found["number"] = station.csv.get_serial_number().params
        found["version"] = station.csv.get_firmware_version().params
        assert station.aus.switch_user_atr(True).error is GeoComCode.OK
        assert station.bap.set_prism_type("MINI").error is GeoComCode.OK
        found["prism"] = station.bap.get_prism_type().params
        found["turned"] = station.aut.turn_to(*aim, atrmode="TARGET").error
        for face in ("first", "second"):
            found[f"{face} face"] = station.tmc.get_face().params
            assert station.tmc.do_measurement().error is GeoComCode.OK
            found[face] = station.tmc.get_simple_measurement(5).params
            assert station.aut.change_face(atrmode="TARGET").error is GeoComCode.OK
        found["nothing"] = station.aut.turn_to(0.0, 0.1, atrmode="TARGET").error
        found["unknown"] = station.com.get_double_precision().error
        return found


async def test_a_foreign_client_and_the_driver_read_the_same_prism(site: dict) -> None:
    tracker = await connected(site)
    about = near(site)
    await tracker.initialize()
    await tracker.point_at(about)
    reading = await tracker.measure(3.0)
    await tracker.change_face()
    other = await tracker.measure(3.0)
    assert (await tracker.state()).face == 2
    await tracker.close()
    sigmas = 6.0 * math.sqrt(sum(reading.covariance[:3]) + sum(other.covariance[:3]))
    assert math.dist(reading.xyz, other.xyz) < sigmas
    assert math.dist(reading.xyz, about) < 30.0

    x, y, z = reading.xyz
    aim = (math.atan2(x, y) % (2.0 * math.pi), math.acos(z / math.hypot(x, y, z)))
    found = await asyncio.to_thread(judged, site["tracker"]["port"], aim)
    assert (found["name"], str(found["number"])) == ("MS60", site["tracker"]["serial"])
    assert (tracker.identity.product, tracker.identity.serial) == ("MS60", str(found["number"]))
    assert found["turned"] is GeoComCode.OK
    assert found["nothing"] is GeoComCode.AUT_NO_TARGET
    assert found["unknown"] is not GeoComCode.OK
    first, second = found["first"], found["second"]
    assert isinstance(first, tuple)
    assert isinstance(second, tuple)
    horizontal, vertical, distance = map(float, first)
    assert 1e3 * distance == pytest.approx(math.hypot(x, y, z), abs=2.0)
    assert horizontal == pytest.approx(aim[0], abs=20 * ARCSEC + 1.0 / math.hypot(x, y))
    assert vertical == pytest.approx(aim[1], abs=20 * ARCSEC + 1.0 / math.hypot(x, y, z))
    assert float(second[1]) == pytest.approx(2.0 * math.pi - vertical, abs=20 * ARCSEC)
    assert float(second[0]) % (2 * math.pi) == pytest.approx(
        (horizontal + math.pi) % (2 * math.pi), abs=20 * ARCSEC
    )


@pytest.mark.parametrize("name", [one.name for one in codes.Rc])
def test_return_codes_are_those_of_the_foreign_client(name: str) -> None:
    assert GeoComCode[name].value == codes.Rc[name].value
