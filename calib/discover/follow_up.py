"""Readings that have not been taken yet, as the model would see them: poses of a follow-up run.

A follow-up has its own frame and its own drift; geometry and machine effects are shared with the
runs there are. What a reading shows may depend on where the machine came from (direction, step),
so columns are made again for every pose that could come before.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.effects.component import Effect
from calib.identify.fitting import Fit
from calib.model.columns import whitened_columns
from calib.model.prediction import Model
from calib.model.state import State
from calib.poses.reach import PoseSet
from calib.runs.stack import STEP_MM, STEP_RAD, Rows
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
    typical = fit.accepted & old.on_platform
    covariance = old.covariance[:, :, typical].mean(axis=2)
    progress = np.linspace(0.0, 1.0, total)
    duration = max(float(np.ptp(old.time_s)), 1.0)
    return Rows(
        machine=old.machine,
        runs=(old.runs[-1],),
        run=np.zeros(total, dtype=np.intp),
        line=np.arange(total, dtype=np.intp),
        pose_name=(*(f"n{k // len(nests)}" for k in range(platform)), *[""] * (total - platform)),
        nest_name=(*list(nests) * count, *list(base) * BASE_READS),
        extension=old.machine.extension(q, header.controller_parameters),
        q=q,
        direction=np.zeros_like(q),
        step=np.zeros_like(q),
        time_s=float(old.time_s.max()) + duration * progress,
        progress=progress,
        position=np.zeros((3, total)),
        covariance=np.repeat(covariance[:, :, None], total, axis=2),
        nest=np.array(places).T,
        on_platform=np.arange(total) < platform,
        fold=np.full(total, -1, dtype=np.intp),
        channels={name: _channel(old, name, channels, total) for name in old.channels},
    )


def _channel(old: Rows, name: str, given: Mapping[str, float], total: int) -> Array:
    values = old.channels[name]
    known = values[np.isfinite(values)]
    if name in given or known.size == 0:
        return np.full(total, given.get(name, np.nan))
    if name in RESAMPLED:
        return np.resize(known, total)
    return np.full(total, known[-1])


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
        self.geometry = linear.jacobian[: self.model.free.size]
        self.frame = linear.jacobian[self.model.free.size :]
        self.state: State = linear.state

    def approached(self, origin: Array | None) -> Rows:
        """The same readings if the machine comes to each pose from coordinates ``origin`` (n,)."""
        origin = self.rows.machine.home_q if origin is None else origin
        step = self.rows.q - origin[:, None]
        threshold = [STEP_MM if a.unit == "mm" else STEP_RAD for a in self.rows.machine.actuators]
        moved = np.abs(step) > np.array(threshold)[:, None]
        return replace(self.rows, direction=np.sign(step) * moved, step=np.where(moved, step, 0.0))

    def columns(self, effect: Effect, values: Array, rows: Rows) -> Array:
        """Whitened derivatives (k, 3, N) by the linear unknowns of an effect."""
        situation = replace(self.situation, rows=rows)
        linear = linear_among(effect.unknowns(rows))
        shapes = whitened_columns(effect.signature(situation, values), situation)
        return np.asarray(shapes[: linear.size][linear])

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
