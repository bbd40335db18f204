"""The live world: noise that is honest, effects with the catalogue's signs."""

import numpy as np
import pytest

from mocks.clock import ManualClock
from mocks.hidden.table import Hidden
from mocks.physics.hexapod_body import AROUND
from mocks.physics.pose import Array, rotation_from_rpy, rotation_from_vector
from mocks.physics.room import HOME_REFLECTOR
from mocks.physics.room import Station as TrackerStation
from mocks.physics.truth import nominal_parameters
from mocks.tracker.sensor import Sensor, refraction_ppm
from mocks.world import World, WorldPlan

LATER_S = 100.0


def world(hidden: dict[str, float] | None = None, smrs: int = 3, seed: int = 2) -> World:
    return World(ManualClock(), WorldPlan(seed=seed, smrs=smrs, hidden=Hidden(hidden or {})))


def go(w: World, extension: list[float]) -> None:
    for leg, s in zip(w.legs, extension, strict=True):
        leg.command(s, 2.0)
    clock = w.clock
    assert isinstance(clock, ManualClock)
    clock.advance(LATER_S)


def leg_lengths(w: World) -> Array:
    """Real leg lengths now, from the true pose."""
    from mocks.physics.hexapod import legs
    from mocks.physics.hexapod_body import true_geometry

    pose = w.pose(np.array([w.clock.now()]))
    g = true_geometry(w.parameters, w.plan.hidden)
    return legs(g, pose).length[0]


def extra(hidden: dict[str, float], extension: list[float]) -> Array:
    """How much longer the legs are with the hidden effects than without."""
    with_it, without = world(hidden), world()
    go(with_it, extension)
    go(without, extension)
    return leg_lengths(with_it) - leg_lengths(without)


@pytest.mark.long
def test_errors_of_readings_are_as_large_as_the_tracker_says() -> None:
    w = world()
    sensor = Sensor(w)
    normalised, sigmas = [], []
    for i in range(1500):
        start = 10.0 + 7.3 * i
        smr = ("smr1", "smr2", "smr3", "base-b1")[i % 4]
        dwell = sensor.dwell(smr, start, start + 3.0)
        true = w.smr_in_tracker(smr, np.array([start + 1.5]))[0]
        root = np.linalg.cholesky(dwell.cov)
        normalised.append(np.linalg.solve(root, dwell.xyz - true))
        sigmas.append(np.sqrt(np.diag(dwell.cov)))
    assert np.mean(np.square(normalised)) == pytest.approx(1.0, abs=0.07)
    assert np.abs(np.mean(normalised, axis=0)).max() < 0.1
    assert np.min(sigmas) > 0.0025
    assert np.max(sigmas) < 0.005


@pytest.mark.long
def test_short_dwells_are_honest_too() -> None:
    w = world()
    sensor = Sensor(w)
    z = []
    for i in range(1000):
        dwell = sensor.dwell("smr2", 6.1 * i + 5.0, 6.1 * i + 5.5)
        true = w.smr_in_tracker("smr2", np.array([6.1 * i + 5.25]))[0]
        z.append(np.linalg.solve(np.linalg.cholesky(dwell.cov), dwell.xyz - true))
    assert np.mean(np.square(z)) == pytest.approx(1.0, abs=0.1)


def test_machine_settles() -> None:
    w = world()
    for leg in w.legs:
        leg.command(8.0, 2.0)
    times = np.array([2.02, 2.05, 2.3, 3.0, 6.0])
    z = w.smr_in_tracker("smr1", times)
    off = np.linalg.norm(z - w.smr_in_tracker("smr1", np.array([60.0])), axis=1)
    assert off[0] > 0.001
    assert off[-1] < 1e-5


def test_machine_jams_where_its_legs_cannot_close() -> None:
    w = world()
    go(w, [5.0] * 6)
    before = w.pose(np.array([w.clock.now()])).position
    go(w, [34.2, -35.7, -35.7, 34.2, -35.7, -35.7])
    assert w.pose(np.array([w.clock.now()])).position == pytest.approx(before)
    assert "jammed" in w.faults
    go(w, [0.0] * 6)
    assert w.pose(np.array([w.clock.now()])).position != pytest.approx(before)


def test_tracker_stands_where_the_examples_stood() -> None:
    for seed in range(20):
        w = world(seed=seed)
        distance = np.linalg.norm(w.nest_in_tracker("3", np.zeros(1)))
        assert 1100.0 < distance < 1500.0


UP = [4.0, 4.5, 5.0, 4.0, 4.5, 5.0]


def test_backlash_shortens_after_moving_out_and_lengthens_after_moving_in() -> None:
    out = extra({"backlash.leg3": 0.02}, UP)
    back = extra({"backlash.leg3": 0.02}, [-s for s in UP])
    assert out == pytest.approx([0, 0, -0.01, 0, 0, 0], abs=1e-7)
    assert back == pytest.approx([0, 0, 0.01, 0, 0, 0], abs=1e-7)


def test_screw_pitch_and_quadratic() -> None:
    assert extra({"screw-pitch.leg2": 1e-3}, UP)[1] == pytest.approx(4.5e-3, abs=1e-7)
    both = extra({"lead-variation.leg5": 1e-4}, UP)
    assert both[4] == pytest.approx(1e-4 * 4.5**2, abs=1e-7)


def test_screw_cyclic() -> None:
    hidden = {"screw-cyclic.leg1.sin": 0.01, "screw-cyclic.leg1.cos": 0.004,
              "screw-cyclic.period": 5.0}  # fmt: skip
    phase = 2 * np.pi * 4.0 / 5.0
    expected = 0.01 * np.sin(phase) + 0.004 * np.cos(phase)
    assert extra(hidden, UP)[0] == pytest.approx(expected, abs=1e-7)


def test_thermal_growth_is_from_20_degrees() -> None:
    w, plain = world({"thermal-growth.a": 1e-5}), world()
    for each in (w, plain):
        each.climate.set_structure(0.0, 30.0)
        go(each, UP)
    warm = float(w.climate.structure(np.array([w.clock.now()]))[0])
    expected = 1e-5 * (warm - 20.0) * leg_lengths(plain)
    assert leg_lengths(w) - leg_lengths(plain) == pytest.approx(expected, rel=3e-3)


def test_gravity_compresses() -> None:
    w, plain = world({"gravity-sag.c": 1e-4}), world()
    for each in (w, plain):
        each.payload_kg = 8.0
        go(each, [0.0] * 6)
    change = leg_lengths(w) - leg_lengths(plain)
    assert np.mean(change) == pytest.approx(-28.655e-4, rel=0.01)


def test_settling_fades_with_its_time_constant() -> None:
    w, plain = world({"settling.k": 1e-3, "settling.tau": 4.0}), world()
    times = np.array([2.0 + 4.0, 2.0 + 8.0])
    for each in (w, plain):
        for leg in each.legs:
            leg.command(6.0, 2.0)
    z = w.pose(times).position[:, 2] - plain.pose(times).position[:, 2]
    assert z[0] / z[1] == pytest.approx(np.e, rel=0.01)
    assert z[0] > 0.0


def test_creep_is_made_good_in_minutes() -> None:
    w, plain = world({"creep.k": 1e-3, "creep.tau": 300.0}), world()
    times = np.array([2.0, 302.0])
    for each in (w, plain):
        for leg in each.legs:
            leg.command(6.0, 2.0)
    z = w.pose(times).position[:, 2] - plain.pose(times).position[:, 2]
    assert z[0] / z[1] == pytest.approx(np.e, rel=0.01)
    assert z[0] < 0.0


@pytest.mark.parametrize("name", ["joint-tilt.leg2.base.y", "joint-tilt.leg4.platform.z"])
def test_joint_tilt_moves_the_platform_a_little(name: str) -> None:
    tilted, plain = world({name: 5e-3}), world()
    extension = [8.0, -8.0, 6.0, -6.0, 4.0, -4.0]
    go(tilted, extension)
    go(plain, extension)
    now = np.array([plain.clock.now()])
    moved = np.linalg.norm(tilted.pose(now).position - plain.pose(now).position)
    assert 1e-6 < moved < 0.1


@pytest.mark.parametrize(
    "name",
    ["unknown.hysteresis.leg4", "unknown.bending.k", "unknown.soft-legs.k", "screw-twist.L"],
)
def test_other_effects_of_the_legs_do_something(name: str) -> None:
    size = {"screw-twist.L": 2.0, "unknown.soft-legs.k": 1e-5}.get(name, 0.02)
    extension = [8.0, -8.0, 6.0, -6.0, 4.0, -4.0]
    assert np.max(np.abs(extra({name: size}, extension))) > 1e-4


def seen(hidden: dict[str, float], nest: str = "3", time: float = LATER_S) -> tuple[Array, Array]:
    """What a noise-free tracker reads for a nest, with and without hidden effects."""
    both = []
    for table in (hidden, {}):
        w = world(table)
        times = np.array([time])
        both.append(w.distortions.seen(w.nest_in_tracker(nest, times), times)[0])
    return both[0], both[1]


def test_tracker_scale_and_offset() -> None:
    scaled, plain = seen({"tracker-scale.k": 2e-5})
    assert scaled == pytest.approx(plain * (1 + 2e-5), abs=1e-9)
    longer, plain = seen({"tracker-offset.r0": 0.1})
    assert longer == pytest.approx(plain * (1 + 0.1 / np.linalg.norm(plain)), abs=1e-9)


def test_tracker_drift_reaches_its_size_at_the_end() -> None:
    hidden = {"tracker-drift.vx": 0.1, "tracker-drift.wz": 1e-4, "tracker-drift.duration": 200.0}
    half, plain = seen(hidden, time=100.0)
    expected = np.array([0.1, 0.0, 0.0]) + np.cross([0.0, 0.0, 1e-4], plain)
    assert half - plain == pytest.approx(0.5 * expected, abs=1e-9)
    assert seen(hidden, time=200.0)[0] - plain == pytest.approx(expected, abs=1e-9)


def test_nest_offset_is_in_the_platform() -> None:
    w, plain = world({"nest-offset.4.x": 0.05}), world()
    now = np.array([0.0])
    move = w.nest_in_tracker("4", now) - plain.nest_in_tracker("4", now)
    axis = plain.station.rotation @ plain.pose(now).rotation[0][:, 0]
    assert move[0] == pytest.approx(0.05 * axis, abs=1e-9)
    assert w.nest_in_tracker("5", now) == pytest.approx(plain.nest_in_tracker("5", now))


def test_frame_shift_comes_at_its_time() -> None:
    hidden = {
        "frame-shift.z": 0.2,
        "frame-shift.rz": 1e-3,
        "frame-shift.t0": 50.0,
        "frame-shift.where": 1,
    }
    before, plain = seen(hidden, "b1", 49.0)
    assert before == pytest.approx(plain)
    after, plain = seen(hidden, "b1", 51.0)
    assert np.linalg.norm(after - plain) == pytest.approx(np.hypot(0.2, 260e-3), rel=1e-3)
    tool, plain = seen({"frame-shift.x": 0.1, "frame-shift.t0": 50.0}, "b1", 51.0)
    assert tool == pytest.approx(plain)
    tool, plain = seen({"frame-shift.x": 0.1, "frame-shift.t0": 50.0}, "3", 51.0)
    assert np.linalg.norm(tool - plain) == pytest.approx(0.1, rel=1e-6)


def test_tide_has_its_period() -> None:
    hidden = {"unknown.tide.amplitude": 0.02, "unknown.tide.period": 40.0}
    crest, plain = seen(hidden, "b1", 10.0)
    trough, _ = seen(hidden, "b1", 30.0)
    assert crest[2] - plain[2] == pytest.approx(0.02, abs=1e-6)
    assert trough[2] - plain[2] == pytest.approx(-0.02, abs=1e-6)


def test_knocked_tracker_sees_everything_moved() -> None:
    w = world()
    before = w.nest_in_tracker("b2", np.array([1.0]))
    clock = w.clock
    assert isinstance(clock, ManualClock)
    clock.advance(10.0)
    w.jump_tracker(np.array([1.0, 0.0, 0.0, 0.0, 0.0, 1e-3]))
    after = w.nest_in_tracker("b2", np.array([1.0, 11.0]))
    turned = before[0] @ rotation_from_vector(np.array([[0, 0, 1e-3]]))[0].T + [1.0, 0.0, 0.0]
    assert after[0] == pytest.approx(before[0])
    assert after[1] == pytest.approx(turned)


def test_wrong_weather_scales_ranges_by_a_ppm_a_kelvin() -> None:
    assert refraction_ppm(21.0, 1013.25, 50.0) == pytest.approx(-0.96)
    w = world()
    sensor = Sensor(w)
    right = sensor.dwell("base-b1", 10.0, 13.0).xyz
    t, p, h = sensor.air(13.0)
    twin = Sensor(w)
    twin.environment = (t + 50.0, p, h)
    wrong = twin.dwell("base-b1", 10.0, 13.0).xyz
    change = np.linalg.norm(wrong) / np.linalg.norm(right) - 1.0
    assert change == pytest.approx(48e-6, abs=5e-6)


def test_unknown_names_of_effects_are_refused() -> None:
    with pytest.raises(ValueError, match=r'no hidden effect "backlash\.leg7"'):
        Hidden({"backlash.leg7": 0.01})
    with pytest.raises(ValueError, match="must be a number"):
        Hidden({"backlash": {"leg1": "much"}})


def test_nested_and_dotted_names_are_the_same() -> None:
    nested = Hidden({"backlash": {"leg3": 0.01}, "unknown": {"tide": {"amplitude": 1.0}}})
    dotted = Hidden({"backlash.leg3": 0.01, "unknown.tide.amplitude": 1.0})
    assert nested.values == dotted.values


def test_true_parameters_may_be_given() -> None:
    nominal = nominal_parameters(World(ManualClock()).machine)
    w = World(ManualClock(), WorldPlan(parameters=nominal))
    pose = w.pose(np.zeros(1))
    assert pose.position[0] == pytest.approx([0.0, 0.0, 220.0], abs=1e-3)


@pytest.mark.parametrize("seed", range(12))
def test_no_smr_hides_another_from_the_tracker(seed: int) -> None:
    """Sights of two nests stay apart over the turns of the platform's workspace."""
    station = TrackerStation(seed, AROUND.place)
    tracker = -station.rotation.T @ station.translation
    turns = np.radians(np.array(np.meshgrid([-9, 0, 9], [-9, 0, 9], [-20, 0, 20]))).reshape(3, -1)
    for rx, ry, rz in turns.T:
        R = rotation_from_rpy(rx, ry, rz)
        nests = [R @ np.array(n) + [0.0, 0.0, 220.0] for n in AROUND.platform_nests.values()]
        for i, j in ((0, 1), (0, 2), (1, 2)):
            sight = (nests[i] - tracker) / np.linalg.norm(nests[i] - tracker)
            apart = nests[j] - nests[i]
            assert np.linalg.norm(apart - (apart @ sight) * sight) > 8.0


@pytest.mark.parametrize("seed", [7, 13, 15000])
def test_a_tracker_is_turned_until_its_own_birdbath_hides_no_nest(seed: int) -> None:
    world, at_once = World(ManualClock(), WorldPlan(seed=seed)), TrackerStation(seed, AROUND.place)
    bath = np.array(HOME_REFLECTOR)
    for nest in (*AROUND.platform_nests, *AROUND.base_nests):
        sight = world.nest_in_tracker(nest, np.zeros(1))[0]
        sight /= np.linalg.norm(sight)
        assert bath @ sight < 0.0 or np.linalg.norm(bath - (bath @ sight) * sight) > 19.0
    turned = world.station.rotation @ at_once.rotation.T
    assert (seed == 7) == np.allclose(turned, np.eye(3))  # as it stood
    np.testing.assert_allclose(turned[2], [0.0, 0.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(world.station.translation, turned @ at_once.translation)
