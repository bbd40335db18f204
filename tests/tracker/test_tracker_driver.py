"""The driver against the mock tracker: good days."""

import asyncio
import time

import numpy as np
import pytest
from tracker_bench import SCALE, Bench, until

from drivers.emscon import EmsconTracker, wire
from drivers.emscon.codes import WeatherMonitor
from drivers.emscon.settings import EmsconSettings
from drivers.errors import ConnectFailed, NoTarget, NotReady, Refused


async def test_identity_comes_from_the_device(bench: Bench) -> None:
    assert bench.tracker.identity.serial == "390793"
    assert bench.tracker.identity.product.startswith("AT901")


async def test_nothing_moves_before_initialisation(bench: Bench) -> None:
    assert not (await bench.tracker.state()).initialized
    with pytest.raises(NotReady, match="not initialised"):
        await bench.tracker.point_at(bench.nest("3"))
    with pytest.raises(NotReady, match="not initialised"):
        await bench.tracker.measure(1.0)


async def test_initialise_twice_takes_time_once(bench: Bench) -> None:
    tracker, asked = bench.tracker, []
    tracker._link.listen(lambda packet: asked.append(packet.command), tracker._link_lost)
    initialize = wire.COMMANDS["Initialize"].code
    await tracker.initialize()
    assert asked.count(initialize) == 1
    await tracker.initialize()
    assert asked.count(initialize) == 1
    assert (await bench.tracker.state()).initialized


async def test_reading_is_the_truth_within_its_uncertainty(locked: Bench) -> None:
    reading = await locked.tracker.measure(3.0)
    sigma = np.sqrt(reading.covariance[:3])
    assert np.all(sigma > 0.002)
    assert np.all(sigma < 0.005)
    off = np.array(reading.xyz) - locked.nest("3")
    assert np.all(np.abs(off) < 5.0 * sigma)


async def test_covariance_of_a_reading_is_radial_and_angular(locked: Bench) -> None:
    reading = await locked.tracker.measure(3.0)
    xx, yy, zz, xy, xz, yz = reading.covariance
    cov = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    along = np.array(reading.xyz) / np.linalg.norm(reading.xyz)
    values, vectors = np.linalg.eigh(cov)
    assert abs(vectors[:, 0] @ along) > 0.9999
    assert values[1] == pytest.approx(values[2], rel=1e-6)


async def test_a_reading_costs_its_dwell_and_little_more(locked: Bench) -> None:
    await locked.tracker.measure(3.0)
    costs = []
    for _ in range(20):
        start = time.perf_counter()
        await locked.tracker.measure(3.0)
        costs.append(time.perf_counter() - start)
    assert min(costs) < 3.0 / SCALE + 0.025


async def test_every_nest_can_be_aimed_at(locked: Bench) -> None:
    for nest in ("3", "4", "5", "b1", "b2", "b3", "b4"):
        await locked.tracker.point_at(locked.nest(nest))
        reading = await locked.tracker.measure(0.5)
        assert np.linalg.norm(np.array(reading.xyz) - locked.nest(nest)) < 0.05


async def test_beam_follows_the_platform(locked: Bench) -> None:
    before = await locked.tracker.measure(0.5)
    for leg in locked.world.legs:
        leg.command(5.0, 1.0)
    await until(lambda: not any(leg.moving for leg in locked.world.legs))
    after = await locked.tracker.measure(0.5)
    assert np.linalg.norm(np.subtract(after.xyz, before.xyz)) > 1.0
    assert np.linalg.norm(np.array(after.xyz) - locked.nest("3")) < 0.05


async def test_no_smr_where_the_beam_points(locked: Bench) -> None:
    x, y, z = locked.nest("3")
    with pytest.raises(NoTarget):
        await locked.tracker.point_at((x, y, z + 80.0))
    assert not (await locked.tracker.state()).locked
    await locked.tracker.go_birdbath()
    assert (await locked.tracker.state()).locked


async def test_unknown_reflector_is_refused_with_the_choice(locked: Bench) -> None:
    with pytest.raises(Refused, match=r"Choose one of: CCR-0.5in, CCR-1.5in, TBR-0.5in"):
        await locked.tracker.select_reflector("cat's eye")


async def test_wrong_reflector_shows_in_the_range(locked: Bench) -> None:
    right = np.linalg.norm((await locked.tracker.measure(1.0)).xyz)
    await locked.tracker.select_reflector("TBR-0.5in")
    wrong = np.linalg.norm((await locked.tracker.measure(1.0)).xyz)
    assert wrong - right == pytest.approx(4.31, abs=0.05)


async def test_stream_yields_samples_at_device_time(locked: Bench) -> None:
    times, points = [], []
    async for sample in locked.tracker.stream(0.05):
        times.append(sample.time_s)
        points.append(sample.xyz)
        if len(times) == 60:
            break
    assert np.diff(times) == pytest.approx(np.full(59, 0.05), abs=2e-6)
    assert np.all(np.std(points, axis=0) < 0.03)
    reading = await locked.tracker.measure(0.5)
    assert np.linalg.norm(np.subtract(reading.xyz, points[-1])) < 0.05


async def test_both_faces(locked: Bench) -> None:
    assert (await locked.tracker.state()).face == 1
    await locked.tracker.change_face()
    assert (await locked.tracker.state()).face == 2
    await locked.tracker.measure(0.5)
    await locked.tracker.point_at(locked.nest("4"))
    assert (await locked.tracker.state()).face == 1


async def test_channels_are_those_of_the_room(locked: Bench) -> None:
    channels = await locked.tracker.channels()
    assert channels["structure_temp_C"] == pytest.approx(locked.world.structure_temp_C(), abs=0.05)
    assert 15.0 < channels["air_temp_C"] < 25.0
    assert 900.0 < channels["pressure_hPa"] < 1100.0


async def test_second_program_is_turned_away(locked: Bench) -> None:
    with pytest.raises(Exception, match=r"another program|closed the connection|broke"):
        await EmsconTracker.connect(locked.server.address, time_scale=SCALE, timeout=2.0)
    await locked.tracker.measure(0.5)


async def test_reconnect_after_close(locked: Bench) -> None:
    await locked.tracker.close()
    again = await EmsconTracker.connect(locked.server.address, time_scale=SCALE)
    try:
        await again.initialize()
        await again.measure(0.5)
    finally:
        await again.close()


async def test_nobody_at_the_address() -> None:
    server = await asyncio.start_server(lambda r, w: None, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    server.close()
    await server.wait_closed()
    with pytest.raises(ConnectFailed, match="nobody answers"):
        await EmsconTracker.connect(f"127.0.0.1:{port}")


async def test_without_an_object_sensor_there_is_no_such_channel(bench: Bench) -> None:
    bench.world.faults.inject("tracker-no-object-sensor")
    await bench.tracker.initialize()
    assert not bench.tracker.can.object_temperature
    assert set(await bench.tracker.channels()) == {"air_temp_C", "pressure_hPa", "humidity"}
    assert any("object" in alarm.what for alarm in bench.alarms)


async def test_without_a_weather_station_somebody_must_state_the_air(bench: Bench) -> None:
    bench.world.faults.inject("tracker-no-weather-station")
    with pytest.raises(Refused, match="no weather station") as caught:
        await bench.tracker.initialize()
    assert "environment" in caught.value.remedy


async def test_air_by_hand_is_used_and_is_no_channel(bench: Bench) -> None:
    bench.world.faults.inject("tracker-no-weather-station")
    settings = EmsconSettings(
        weather_monitor=WeatherMonitor.OFF, environment=(21.0, 1000.0, 40.0), margin_s=1.0
    )
    await bench.tracker.close()
    tracker = await EmsconTracker.connect(bench.server.address, SCALE, settings)
    await tracker.initialize()
    await tracker.point_at(bench.nest("3"))
    reading = await tracker.measure(1.0)
    assert reading.temperature_C is None
    assert bench.server.instrument.sensor.environment == (21.0, 1000.0, 40.0)
    assert set(await tracker.channels()) == {"structure_temp_C"}
    await tracker.close()
