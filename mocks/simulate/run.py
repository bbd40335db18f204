"""Simulate a campaign: rows, truth, readings."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from calib.mechanism.description import Machine
from mocks.physics.body import Body
from mocks.physics.pose import Array, Pose
from mocks.physics.room import Distortions, Station
from mocks.physics.signals import Wander, mean_variance
from mocks.physics.truth import draw_parameters
from mocks.simulate import machine as machines
from mocks.simulate.layout import Layout, arrange
from mocks.simulate.plan import RunPlan
from mocks.tracker.sensor import SAMPLES_PER_S, NoiseLevels
from mocks.world import SLOW_TAU_S

DWELL_S = 3.0
CHANNEL_TAU_S = 60.0
LARGEST_DELAY_S = 8.0


@dataclass(frozen=True)
class SimulatedRun:
    """A campaign as it was measured, and the truth about it.

    ``q`` (R, n); ``xyz`` (R, 3) mm, NaN where a row is no reading; ``covariance`` (R, 6):
    xx, yy, zz, xy, xz, yz in mm^2; ``poses`` (N, k) as commanded; ``truth`` the platform's true
    poses at every row; ``strays`` the rows that were falsified.
    """

    plan: RunPlan
    layout: Layout
    q: Array
    xyz: Array
    covariance: Array
    channels: Mapping[str, Array]
    poses: Array
    parameters: Mapping[str, float]
    frame: list[float]
    truth: Pose
    strays: tuple[int, ...]


def simulate(plan: RunPlan) -> SimulatedRun:
    """Run a campaign; raises ValueError for poses that are out of reach."""
    body = plan.body
    machine, around = body.machine, body.around
    parameters = dict(plan.parameters or draw_parameters(machine, plan.seed, plan.prior))
    held = machines.controller_parameters(machine, plan.controller)
    poses = (
        machines.random_poses(body, held, plan, plan.poses)
        if isinstance(plan.poses, int)
        else np.asarray(plan.poses, dtype=float)
    )
    rows = arrange(plan, len(poses), around)
    q = machines.commanded_q(body, held, poses, rows)
    _check_reach(q, machine)
    channels = _channels(plan, rows)
    load = plan.load or around.load
    extension = q - body.reference(held)
    truth = machines.true_poses(body, parameters, plan, load, extension, rows.time, channels)
    station = Station(plan.seed, around.place)
    seen = _seen(plan, rows, truth, station, body)
    covariance = _covariance(plan, seen)
    xyz = seen + _noise(plan, seen)
    strays = _strays(plan, rows, xyz)
    xyz[~rows.reading] = np.nan
    return SimulatedRun(
        plan, rows, q, xyz, covariance, _columns(plan, channels), poses, parameters,
        station.frame(), truth, strays,
    )  # fmt: skip


def _check_reach(q: Array, machine: Machine) -> None:
    low, high = machine.q_limits.T
    inside = np.all((q >= low - 1e-6) & (q <= high + 1e-6), axis=1)
    if not inside.all():
        unit = machine.actuators[0].unit
        raise ValueError(
            f"a pose is out of reach: q {np.round(q[~inside][0], 3).tolist()} {unit} where "
            f"{low[0]:g} to {high[0]:g} are allowed"
        )


def _channels(plan: RunPlan, rows: Layout) -> dict[str, Array]:
    rng, profile, time = plan.rng(1), plan.profile, rows.time
    wander = Wander(rng, CHANNEL_TAU_S, 2, terms=16).at(time)
    share = time / max(float(time[-1]), 1.0)
    masses = np.asarray(profile.payload_kg)
    turn = np.minimum((share * masses.size).astype(int), masses.size - 1)
    warm = profile.rise_K * (1.0 - np.exp(-2.5 * share)) / (1.0 - np.exp(-2.5))
    delay = rng.uniform(0.2, LARGEST_DELAY_S, time.size)
    return {
        "structure_temp_C": np.round(profile.start_C + warm + 0.03 * wander[0], 3),
        "air_temp_C": np.round(profile.air_C + 0.25 * wander[1], 3),
        "payload_kg": masses[turn],
        "delay_s": np.round(delay, 2),
    }


def _columns(plan: RunPlan, channels: dict[str, Array]) -> dict[str, Array]:
    delays = plan.delays or plan.hidden.has("settling.")
    return {name: v for name, v in channels.items() if name != "delay_s" or delays}


def _seen(plan: RunPlan, rows: Layout, truth: Pose, station: Station, body: Body) -> Array:
    """What a noise-free tracker reads at every row, tracker frame, (R, 3), mm."""
    around, distortions = body.around, Distortions(plan.hidden, body)
    down = -truth.rotation[:, 2, :]
    names = np.array(rows.nest)
    base = np.tile([0.0, 0.0, 0.0], (names.size, 1))
    for nest, centre in (*around.platform_nests.items(), *around.base_nests.items()):
        here = names == nest
        if not here.any():
            continue
        points = distortions.nest(nest, np.asarray(centre), rows.time[here], down[here])
        if nest in around.platform_nests:
            points = Pose(truth.position[here], truth.rotation[here]).points(points)
        base[here] = points
    tracker = station.to_tracker(distortions.base(base, rows.time))
    return distortions.seen(tracker, rows.time, float(rows.time[-1]))


def _beam_frames(points: Array) -> tuple[Array, Array]:
    """Unit vectors along and across the beam, (R, 3, 3), and distances (R,)."""
    distance = np.linalg.norm(points, axis=1)
    along = points / distance[:, None]
    sideways = np.column_stack([-along[:, 1], along[:, 0], np.zeros(len(points))])
    sideways /= np.linalg.norm(sideways, axis=1)[:, None]
    return np.stack([along, sideways, np.cross(along, sideways)], axis=1), distance


def _tracker_sigma(distance: Array) -> Array:
    """Standard deviation of a dwell's mean along and across the beam, (R, 3), mm."""
    levels, samples = NoiseLevels(), SAMPLES_PER_S * DWELL_S
    share = mean_variance(DWELL_S, SLOW_TAU_S)
    along = np.sqrt(levels.white_range**2 / samples + share * levels.slow_range**2)
    across = np.sqrt(levels.white_angle**2 / samples + share * levels.slow_angle**2) * distance
    return np.column_stack([np.full(distance.size, along), across, across])


def _covariance(plan: RunPlan, points: Array) -> Array:
    if plan.noise_mm is not None:
        variance = np.full((len(points), 3), plan.noise_mm**2)
        return np.hstack([variance, np.zeros((len(points), 3))])
    frames, distance = _beam_frames(points)
    sigma = _tracker_sigma(distance)
    full = np.einsum("nki,nk,nkj->nij", frames, sigma**2, frames)
    return np.stack(
        [full[:, i, j] for i, j in ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))], axis=1
    )


def _noise(plan: RunPlan, points: Array) -> Array:
    draws = plan.rng(2).standard_normal(points.shape)
    if plan.noise_mm is not None:
        return plan.noise_mm * draws
    frames, distance = _beam_frames(points)
    return np.asarray(np.einsum("nk,nki->ni", draws * _tracker_sigma(distance), frames))


def _strays(plan: RunPlan, rows: Layout, xyz: Array) -> tuple[int, ...]:
    """Falsify some readings in place; returns their rows."""
    if not plan.strays:
        return ()
    rng = plan.rng(3)
    chosen = rng.choice(np.flatnonzero(rows.reading), plan.strays, replace=False)
    direction = rng.standard_normal((plan.strays, 3))
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    size = np.exp(rng.uniform(np.log(0.2), np.log(2.0), plan.strays))
    xyz[chosen] += direction * size[:, None]
    return tuple(int(row) for row in np.sort(chosen))
