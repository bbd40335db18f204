"""The tracking mechanism: every number that a correct implementation reaches (Zhang et al.)."""

import tomllib
from functools import lru_cache
from importlib.resources import files

import numpy as np
import pytest

from app.reproduce.pose_fit import fit_poses
from calib.arrays import Array
from calib.mechanism.closure import Closure
from calib.mechanism.description import Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.parse import parse_machine
from calib.mechanism.rigid import Poses, exponential, pose_difference, product, to_euler
from calib.mechanism.solve import Configuration, forward, inverse
from calib.mechanism.sweep import Standing
from calib.mechanism.task import task_values
from calib.mechanism.variants import with_closure

DEG = np.pi / 180.0
POSE = np.array([[15.0], [20.0]]) * DEG
GRID = DEG * np.array([(0, 0), *((t, f) for t in range(10, 70, 10) for f in range(0, 360, 10))]).T
CLOSURES = ("", "LS", "D3")
TABLES = tomllib.loads(files("app.reproduce").joinpath("papers/zhang.toml").read_text())["tables"]
GOOD = [row for row in TABLES["errors"] if row[0] not in TABLES["contradictory"]]
L = 317.0
THETA_L = np.arccos(75.0 / L)


@lru_cache
def machine(closure: str = "") -> Machine:
    own = parse_machine(files("calib.machines").joinpath("ptm.toml").read_text(), "ptm.toml")
    return with_closure(own, closure) if closure else own


@lru_cache
def at(closure: str, where: str) -> Configuration:
    found = inverse(machine(closure), POSE if where == "pose" else GRID)
    assert found.converged.all()
    return found


@lru_cache
def jacobian(closure: str, where: str = "pose") -> Array:
    return pose_jacobians(machine(closure), at(closure, where)).parameters


def column(closure: str, name: str) -> Array:
    return jacobian(closure)[machine().index(name), :, 0]


def unit(name: str) -> float:
    return DEG if machine().parameters[machine().index(name)].unit == "rad" else 1.0


def norms(twist: Array) -> tuple[float, float]:
    return float(np.linalg.norm(twist[:3])), float(np.linalg.norm(twist[3:])) / DEG


def joint(found: Configuration, name: str) -> Array:
    names = [f"{limb.name}.{j.name}" for limb in machine().limbs for j in limb.joints]
    return found.passive[names.index(name)]


def test_it_has_the_83_errors() -> None:
    assert len(machine().parameters) == 83
    assert np.all(machine().nominal == 0.0)
    assert sorted(set(machine().prior_sigma)) == pytest.approx([0.038 * DEG, 0.1])


def test_the_platform_mirrors_the_base_over_the_workspace() -> None:
    tilt, azimuth = GRID
    n = np.array([np.sin(tilt / 2) * np.cos(azimuth), np.sin(tilt / 2) * np.sin(azimuth),
                  np.cos(tilt / 2)])  # fmt: skip
    mirror = np.eye(3)[:, :, None] - 2.0 * n[:, None] * n[None]
    poses = at("", "grid").poses
    assert np.abs(poses.position - 402.0 * n).max() < 1e-9
    assert np.abs(poses.rotation - mirror * np.array([1.0, 1.0, -1.0])[:, None]).max() < 1e-12


def test_angles_of_the_links_from_the_vertical() -> None:
    found = at("", "pose")
    home = np.degrees(np.arccos(201.0 / L))
    psi = [*np.degrees(found.extension[:, 0]),
           *(np.degrees(joint(found, f"limb{i}.theta_1")[0]) for i in (3, 4))]  # fmt: skip
    expected = [61.84022, 54.43646, 39.09556, 46.10836]
    assert home + np.array(psi) == pytest.approx(expected, abs=1e-5)
    assert home == pytest.approx(50.64900, abs=1e-5)


def test_joint_angles_of_the_first_limb() -> None:
    found = at("", "pose")
    first = np.arccos(201.0 / L) - THETA_L + found.extension[0, 0]
    angles = [first, *(joint(found, f"limb1.theta_{k}")[0] for k in (2, 3, 4, 5))]
    expected = [-14.47423, -1.40829, 34.58023, 5.78402, 6.05978]
    assert np.degrees(angles) == pytest.approx(expected, abs=1e-5)


def test_ranks_of_the_wrenches() -> None:
    found = at("LS", "pose")
    state = Standing.of(found)
    closure = Closure(machine("LS"), machine("LS").nominal[:, None], found.extension, state)
    rows = closure.rows()[0][:, :, 0]
    actuation, constraints = rows[:2], rows[2:]
    assert actuation.shape == (2, 6)

    def rank(matrix: Array) -> int:
        return int(np.linalg.matrix_rank(matrix, tol=1e-10 * np.linalg.norm(matrix)))

    assert (rank(rows), rank(constraints), rank(constraints[:4])) == (6, 4, 3)


def rigid_errors(v: Array, omega: Array, part: str) -> Array:
    """Errors of all limbs that move the base (or the platform's joints) as one body."""
    errors = {}
    for i in range(4):
        place = i * np.pi / 2
        out = np.array([np.cos(place), np.sin(place), 0.0])
        axes = np.array([out, [-out[1], out[0], 0.0], [0.0, 0.0, 1.0]])
        shift, turn = axes @ (v + np.cross(omega, 150.0 * out)), axes @ omega
        joint = "1" if part == "0" else "5"
        for k, axis in enumerate("xyz"):
            errors[f"limb{i + 1}.{part}d{axis}{joint}"] = shift[k]
        errors[f"limb{i + 1}.{part}da{joint}"] = turn[0]
        errors[f"limb{i + 1}.{part}dg{joint}"] = turn[2]
        if part == "0" and i < 2:
            errors[f"limb{i + 1}.dtheta"] = turn[1]
    for k, axis in enumerate("xyz"):
        errors[f"limb5.{part}d{axis}{'1' if part == '0' else '5'}"] = v[k]
    return machine().vector(errors)


@pytest.mark.parametrize("closure", CLOSURES)
@pytest.mark.parametrize("part", ["0", "6"])
def test_a_rigid_motion_of_base_or_platform_put_in_as_errors(closure: str, part: str) -> None:
    rng = np.random.default_rng(5)
    v, omega = rng.normal(size=3), 1e-2 * rng.normal(size=3)
    found = np.einsum("pi,p->i", jacobian(closure)[:, :, 0], rigid_errors(v, omega, part))
    poses = at(closure, "pose").poses
    if part == "0":
        expected = np.concatenate([v + np.cross(omega, poses.position[:, 0]), omega])
    else:
        R = poses.rotation[:, :, 0]
        expected = -np.concatenate([R @ v, R @ omega])
    assert found == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("closure", CLOSURES)
def test_the_home_error_is_two_of_the_others(closure: str) -> None:
    two = np.cos(THETA_L) * column(closure, "limb1.1dx2")
    two += np.sin(THETA_L) * column(closure, "limb1.1dy2")
    assert column(closure, "limb1.dtheta") == pytest.approx(L * two, abs=1e-11)


@pytest.mark.parametrize("closure", CLOSURES)
@pytest.mark.parametrize("no", [28, 21, 23, 27, 19])
def test_rows_that_do_not_depend_on_the_closure(closure: str, no: int) -> None:
    _, name, value, *computed = TABLES["errors"][no - 1]
    got = norms(value * unit(name) * column(closure, name))
    assert got == pytest.approx(computed[:2], abs=1e-4)


@pytest.mark.parametrize("row", GOOD, ids=lambda row: row[1])
def test_limb_3_released_reaches_the_computed_columns(row: list[float]) -> None:
    _, name, value, position, orientation = row[:5]
    got = norms(value * unit(name) * column("D3", name))
    assert got[0] == pytest.approx(position, rel=0.0075)
    assert got[1] == pytest.approx(orientation, rel=0.0075)


@pytest.mark.parametrize("row", GOOD, ids=lambda row: row[1])
def test_exact_closure_with_limb_3_released_reaches_solidworks(row: list[float]) -> None:
    """Orientation as the norm of differences of ZYX Euler angles, as the paper took it."""
    no, name, value, *_, position, orientation = row
    sign = -1.0 if no in TABLES["reversed"] else 1.0
    there = at("D3", "pose")
    errors = machine().vector({name: sign * value * unit(name)})
    moved = forward(machine("D3"), there.extension, errors, start=there)
    assert moved.converged.all()
    shift = np.linalg.norm(moved.poses.position - there.poses.position)
    turn = np.linalg.norm(to_euler(moved.poses.rotation) - to_euler(there.poses.rotation))
    assert shift == pytest.approx(position, abs=1.0e-3)
    assert turn / DEG == pytest.approx(orientation, abs=2.5e-4)


def slope(linear: str, exact: str) -> float:
    """Of exact minus linear against the size of the errors, in a doubly logarithmic plot."""
    rng = np.random.default_rng(6)
    errors = machine().prior_sigma * rng.normal(size=83)
    there = at(exact, "pose")
    step = np.einsum("pi,p->i", jacobian(linear)[:, :, 0], errors)
    sizes, gaps = np.array([1.0, 0.3, 0.1, 0.03]), []
    for size in sizes:
        moved = forward(machine(exact), there.extension, size * errors, start=there)
        twist = pose_difference(there.poses, moved.poses)[:, 0]
        gaps.append(np.linalg.norm((twist - size * step) * np.repeat([1.0, 402.0], 3)))
    return float(np.polyfit(np.log(sizes), np.log(gaps), 1)[0])


@pytest.mark.parametrize("closure", ["", "D3"])
def test_exact_minus_linear_falls_with_the_square(closure: str) -> None:
    assert slope(closure, closure) == pytest.approx(2.0, abs=0.03)


def test_equation_20_as_printed_is_the_first_order_of_no_mechanism() -> None:
    assert slope("LS", "") == pytest.approx(1.0, abs=0.03)


@pytest.mark.parametrize("limb", ["limb1", "limb2"])
@pytest.mark.parametrize(
    ("name", "position", "orientation"),
    [("dtheta", 4.2430, 1.2095), ("0dx1", 0.6404, 0.1790), ("0da1", 1.0806, 0.3913),
     ("4dz5", 0.8025, 0.2243), ("6dx5", 0.6147, 0.1716)],
)  # fmt: skip
def test_global_sensitivity(limb: str, name: str, position: float, orientation: float) -> None:
    name = f"{limb}.{name}"
    columns = jacobian("LS", "grid")[machine().index(name)] * unit(name)
    assert np.linalg.norm(columns[:3], axis=0).mean() == pytest.approx(position, rel=2e-4)
    assert np.linalg.norm(columns[3:], axis=0).mean() / DEG == pytest.approx(orientation, abs=6e-5)


@pytest.mark.parametrize(("closure", "rank"), [("LS", 55), ("D3", 46), ("", 55)])
def test_rank_over_the_workspace(closure: str, rank: int) -> None:
    J = jacobian(closure, "grid") * np.repeat([1.0, 402.0], 3)[:, None]
    scaled = J.reshape(83, -1) * machine().prior_sigma[:, None]
    values = np.linalg.svd(scaled, compute_uv=False)
    assert values[rank - 1] > 1e-6 * values[0]
    assert values[rank] < 1e-14 * values[0]


def calibrated(names: list[str] | None, seed: int) -> tuple[Machine, Array, Array, Configuration]:
    """One prototype measured at 50 poses with 10 um and 0.004 deg: truth, fit, fresh poses."""
    rng = np.random.default_rng(seed)
    own = machine()
    truth = own.prior_sigma * rng.normal(size=83)
    tilt = np.arccos(rng.uniform(np.cos(60 * DEG), 1.0, 550))
    start = inverse(own, np.array([tilt, rng.uniform(0, 2 * np.pi, 550)]))
    poses = forward(own, start.extension, truth, start=start).poses
    sigma = np.repeat([0.010, 0.004 * DEG], 3)
    noise = sigma[:, None] * rng.normal(size=(6, 50))
    measured = Poses(
        poses.position[:, :50] + noise[:3],
        product(exponential(noise[3:]), poses.rotation[:, :, :50]),
    )
    free = None if names is None else np.array([own.index(n) for n in names])
    prior = own.prior_sigma if free is None else None
    fit = fit_poses(own, start.take(slice(0, 50)), measured, sigma, free, prior)
    return own, truth, fit.values, start.take(slice(50, None))


def rms(machine: Machine, truth: Array, values: Array, fresh: Configuration) -> tuple[float, float]:
    """Position (mm) and orientation (deg) left on poses that were not fitted."""
    real = forward(machine, fresh.extension, truth, start=fresh).poses
    model = forward(machine, fresh.extension, values, start=fresh).poses
    left = np.sum(pose_difference(model, real).reshape(2, 3, -1) ** 2, axis=1).mean(axis=1)
    return float(np.sqrt(left[0])), float(np.sqrt(left[1])) / DEG


@pytest.mark.long
@pytest.mark.parametrize("seed", [11, 12, 13])
def test_calibration_with_all_errors_and_priors(seed: int) -> None:
    own, truth, values, fresh = calibrated(None, seed)
    before = rms(own, truth, own.nominal, fresh)
    after = rms(own, truth, values, fresh)
    assert 0.15 < before[0] < 1.0
    assert after[0] <= 0.015
    assert after[1] <= 0.006


@pytest.mark.long
def test_calibration_of_the_essential_errors_alone_is_worse() -> None:
    text = files("app.reproduce").joinpath("papers/zhang.toml").read_text()
    essential = tomllib.loads(text)["sensitivity"]["names"]
    assert len(essential) == 55
    left = [rms(*calibrated(essential, seed))[0] for seed in (11, 12)]
    best = [rms(*calibrated(None, seed))[0] for seed in (11, 12)]
    assert np.mean(left) > 4.0 * np.mean(best)


def test_the_motors_correct_pointing_only() -> None:
    own, truth, values, fresh = calibrated(None, 14)
    wanted = task_values(own.task, fresh.poses)
    commanded = inverse(own, wanted, values, start=fresh)
    reached = forward(own, commanded.extension, truth, start=fresh).poses
    raw = forward(own, fresh.extension, truth, start=fresh).poses

    def pointing(poses: Poses) -> float:
        cosine = np.sum(poses.rotation[:, 2] * fresh.poses.rotation[:, 2], axis=0)
        return float(np.degrees(np.sqrt(np.mean(np.arccos(np.clip(cosine, -1, 1)) ** 2))))

    assert pointing(raw) > 0.08
    assert pointing(reached) < 0.006
    assert np.linalg.norm(reached.position - fresh.poses.position, axis=0).mean() > 0.05
