"""Readings that have not been taken yet, as the model would see them: poses of a follow-up run.

A follow-up is a run of its own: it has its own frame and its own drift, and begins at home with no
past; geometry and machine effects are shared with the runs there are. What a reading shows may
depend on the whole way to its pose, so columns are made again after every pose that is chosen.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from calib.arrays import Array, IntArray
from calib.effects.component import Effect
from calib.errors import BadInput
from calib.identify.fitting import Fit
from calib.identify.taking import noise_covariance, taken
from calib.model.columns import whitened_columns
from calib.model.prediction import Model
from calib.model.state import Linearised, State
from calib.noise import WHITE, Noise
from calib.poses.reach import PoseSet
from calib.runs.commanded import CommandedPath
from calib.runs.stack import Rows
from calib.unknown import linear_among

BASE_READS = 2
"""How often every base nest is read in a follow-up."""
RESAMPLED = ("delay_s", "cycle")
"""Channels that go on as they were; all others stand at the value asked for."""


def own_to_each_run(effect: Effect, rows: Rows) -> bool:
    """Whether every run has its own unknowns of this effect (a drift)."""
    one = replace(rows, runs=rows.runs[:1])
    two = replace(rows, runs=(rows.runs[0], rows.runs[0]))
    return len(effect.unknowns(two)) != len(effect.unknowns(one))


def hypothetical_rows(fit: Fit, poses: PoseSet, channels: Mapping[str, float]) -> Rows:
    """Readings of every platform nest at each of C poses, then of every base nest, twice.

    Rows are nest after nest within a pose; ``channels`` overrides the last value of a channel.
    Every pose is the first after home. ``time_s`` is spread over the follow-up, for drifts; the
    clock of the path is that of the visits.
    """
    old = fit.model.rows
    header = old.runs[-1].header
    nests, base = header.platform_nests, header.base_nests
    count = poses.count
    platform = count * len(nests)
    total = platform + BASE_READS * len(base)
    q = np.empty((len(old.machine.actuators), total))
    q[:, :platform] = np.repeat(poses.q, len(nests), axis=1)
    q[:, platform:] = old.machine.home_q[:, None]
    places = [*list(nests.values()) * count, *list(base.values()) * BASE_READS]
    typical = fit.accepted & old.on_platform & old.placed & old.optical
    if not typical.any():
        raise BadInput(
            "no reading of this run is a point on the platform in the frame of a tracker",
            place=old.runs[-1].source,
            remedy="Follow-up poses are chosen for a tracker's points; choose poses for other "
            "instruments with pkmcal poses",
        )
    covariance = old.covariance[:, :, typical].mean(axis=2)
    progress = np.linspace(0.0, 1.0, total)
    duration = max(float(np.ptp(old.time_s)), 1.0)
    path, stops = _way(old, poses, [])
    return Rows(
        machine=old.machine,
        runs=(old.runs[-1],),
        run=np.zeros(total, dtype=np.intp),
        line=np.arange(total, dtype=np.intp),
        pose_name=(*(f"n{k // len(nests)}" for k in range(platform)), *[""] * (total - platform)),
        nest_name=(*list(nests) * count, *list(base) * BASE_READS),
        extension=old.machine.extension(q, header.controller_parameters),
        q=q,
        path=path,
        at=np.concatenate(
            [np.repeat(stops, len(nests)), np.zeros(total - platform, dtype=np.intp)]
        ),
        time_s=float(old.time_s.max()) + duration * progress,
        progress=progress,
        position=np.zeros((3, total)),
        covariance=np.repeat(covariance[:, :, None], total, axis=2),
        nest=np.array(places).T,
        on_platform=np.arange(total) < platform,
        fold=np.full(total, -1, dtype=np.intp),
        channels={name: _channel(old, name, channels, total) for name in old.channels},
    )


def _way(old: Rows, poses: PoseSet, chosen: Sequence[int]) -> tuple[CommandedPath, IntArray]:
    """Path from home over the chosen poses, and the row (C,) of each pose as the next on it."""
    machine, held = old.machine, old.runs[-1].header.controller_parameters
    q, begin = machine.extension(poses.q, held), float(old.time_s.max())
    pace = max(float(np.ptp(old.time_s)), 1.0) / np.unique(old.path.stop).size
    home = machine.extension(machine.home_q[:, None], held)
    path = CommandedPath.of_run(home, np.array([begin]), old.path.motion)
    for number, index in enumerate(chosen, start=1):
        path = path.branched(path.count - 1, q[:, [index]], begin + pace * number)
    here = path.count
    path = path.branched(here - 1, q, begin + pace * here)
    return path, np.arange(here, path.count, dtype=np.intp)


def _channel(old: Rows, name: str, given: Mapping[str, float], total: int) -> Array:
    values = old.channels[name]
    known = values[np.isfinite(values)]
    if name in given or known.size == 0:
        return np.full(total, given.get(name, np.nan))
    if name in RESAMPLED:
        return np.resize(known, total)
    return np.full(total, known[-1])


def _corrected(linear: Linearised, noise: Noise) -> Array:
    """Whitener (3, 3, N) of each new reading by its own noise, the machine's repeatability in it.

    What readings share in time is left aside: a new run has a new frame, and its differences are
    known no worse for it.
    """
    every = np.ones(linear.whitened.shape[1], dtype=bool)
    own = noise_covariance(linear, replace(noise, scale=noise.narrow), every)
    own = own + taken(linear, every).variance_by_visit(noise)
    return np.moveaxis(np.linalg.inv(np.linalg.cholesky(np.moveaxis(own, -1, 0))), 0, -1)


class FollowUp:
    """Columns of the readings that a follow-up run could take.

    Parameters
    ----------
    fit : Fit
        Of the runs there are.
    poses : PoseSet
        C candidate poses.
    channels : mapping
        Values of channels in the follow-up (payload, temperature); else as they were last.
    """

    def __init__(self, fit: Fit, poses: PoseSet, channels: Mapping[str, float]) -> None:
        self.fit, self.poses = fit, poses
        self.rows = hypothetical_rows(fit, poses, channels)
        self.nests = len(self.rows.runs[0].header.platform_nests)
        self.model = Model(self.rows, ())
        state = fit.linear.state
        start = self.model.start(state.frame_rotation[:, :, -1:], state.frame_position[:, -1:])
        start = replace(start, parameters=state.parameters)
        linear = self.model.linearise(start)
        self.situation = linear.situation
        self._own = None if fit.noise == WHITE else _corrected(linear, fit.noise)
        jacobian = self._as_noisy(linear.jacobian)
        self.geometry = jacobian[: self.model.free.size]
        self.frame = jacobian[self.model.free.size :]
        self.state: State = linear.state

    def approached(self, chosen: Sequence[int]) -> Rows:
        """The same readings if the machine goes from home to the ``chosen`` poses, then to each."""
        path, stops = _way(self.fit.model.rows, self.poses, chosen)
        at = self.rows.at.copy()
        at[: stops.size * self.nests] = np.repeat(stops, self.nests)
        return replace(self.rows, path=path, at=at)

    def columns(self, effect: Effect, values: Array, rows: Rows) -> Array:
        """Whitened derivatives (k, 3, N) by an effect's linear unknowns; none if it is over."""
        situation = replace(self.situation, rows=rows)
        linear = linear_among(effect.unknowns(rows))
        if effect.ends_with_run:
            return np.zeros((int(linear.sum()), 3, rows.count))
        shapes = whitened_columns(effect.signature(situation, values), situation)
        return self._as_noisy(np.asarray(shapes[: linear.size][linear]))

    def _as_noisy(self, columns: Array) -> Array:
        """Columns (k, 3, N) in stated sigmas as what they are worth with the noise of the fit."""
        if self._own is None:
            return columns
        return np.asarray(np.einsum("ijn,kjn->kin", self._own, columns))

    def by_pose(self, columns: Array) -> Array:
        """(k, 3, N) -> (C, k, 3 nests): the block of each candidate pose."""
        count = self.poses.count
        platform = columns[:, :, : count * self.nests]
        shaped = platform.reshape(columns.shape[0], 3, count, self.nests)
        return np.ascontiguousarray(
            np.moveaxis(shaped, 2, 0).reshape(count, columns.shape[0], 3 * self.nests)
        )

    def of_base(self, columns: Array) -> Array:
        """(k, 3, N) -> (k, 3 B): readings of the base nests, always taken."""
        own = columns[:, :, self.poses.count * self.nests :]
        return np.ascontiguousarray(own.reshape(columns.shape[0], -1))
