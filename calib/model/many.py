"""One model at many places at once: D sets of parameters and frames for the same readings.

Of models of the geometry alone: without effects, with points that are read, with an exact setup.
All arrays go set after set, so that the engine solves the poses of all sets in one call.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.effects.lever import apply, apply_each, lever_of, through, whitened_frame
from calib.errors import BadInput
from calib.mechanism.configuration import Configuration
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.rigid import cross, exponential, rotate
from calib.mechanism.solve import forward
from calib.model.prediction import Model
from calib.model.state import State


@dataclass(frozen=True, eq=False)
class Places:
    """Where D sets are: parameters (P, D), frames (3, 3, K, D) and (3, K, D)."""

    parameters: Array
    rotation: Array
    position: Array

    @classmethod
    def around(cls, state: State, count: int) -> "Places":
        """All sets where one model is."""
        return cls(
            np.repeat(state.parameters[:, None], count, axis=1),
            np.repeat(state.frame_rotation[..., None], count, axis=-1),
            np.repeat(state.frame_position[..., None], count, axis=-1),
        )

    @property
    def count(self) -> int:
        """Number of sets D."""
        return int(self.parameters.shape[1])

    def moved(self, free: IntArray, step: Array) -> "Places":
        """Take steps (p, D), as :meth:`Model.moved` does."""
        parameters = self.parameters.copy()
        parameters[free] += step[: free.size]
        frame = step[free.size :].reshape(-1, 6, self.count).transpose(1, 0, 2)
        turn = exponential(frame[3:].reshape(3, -1)).reshape(3, 3, *frame.shape[1:])
        turned: Array = np.einsum("ijkd,jlkd->ilkd", turn, self.rotation)
        return Places(parameters, turned, self.position + frame[:3])


class Many:
    """A model's usable readings (A of them) at D places."""

    def __init__(self, model: Model) -> None:
        self.model = model
        self.kept = np.flatnonzero(model.usable)
        self.run = model.rows.run[self.kept]

    @staticmethod
    def possible(model: Model) -> bool:
        """Whether a model is of the geometry alone."""
        return not (model.effects or model.setup.unknowns or model.rows.sensed is not None)

    def closed(self, places: Places, near: Configuration | None = None) -> Configuration:
        """The machine of every set at every state; ``near`` of one set, or of all.

        Poses that do not close are told by ``converged``.
        """
        machine, (first, _) = self.model.machine, self.model.states
        if near is not None and near.count == first.size:
            near = near.take(np.tile(np.arange(near.count), places.count))
        extension = np.tile(self.model.rows.extension[:, first], places.count)
        return forward(machine, extension, self._over_states(places.parameters), near)

    def closing(self, closed: Configuration) -> BoolArray:
        """Sets (D,) that close at all states."""
        return np.asarray(closed.converged.reshape(-1, self.model.states[0].size).all(axis=1))

    def seen(self, places: Places, closed: Configuration) -> Array:
        """What is read (3, A, D), mm, in the frames."""
        base, turn, _ = self._readings(places, closed)
        origin = places.position[:, self.run].transpose(0, 2, 1).reshape(3, -1)
        seen = rotate(turn, base) + origin
        return seen.reshape(3, places.count, -1).transpose(0, 2, 1)

    def whitened(self, residual: Array) -> Array:
        """Residuals (3, A, D) in sigmas, set by set, (D, 3 A)."""
        count = residual.shape[2]
        flat = residual.transpose(0, 2, 1).reshape(3, -1)
        return _by_set(apply(self._each(self.model.rows.whitener, count), flat), count)

    def jacobian(self, places: Places, closed: Configuration) -> Array:
        """Whitened derivatives (D, p, 3 A) by all unknowns."""
        model, count = self.model, places.count
        base, turn, state = self._readings(places, closed)
        parameters = self._over_states(places.parameters)
        twists = pose_jacobians(model.machine, closed, parameters).parameters
        whitener = self._each(model.rows.whitener, count)
        on = np.tile(model.rows.on_platform[self.kept], count)
        lever = lever_of(whitened_frame(whitener, turn), base - closed.poses.position[:, state], on)
        own = _by_set(through(lever, twists[model.free][:, :, state]), count)
        turned = rotate(turn, base)
        motions = np.zeros((6, *turned.shape))
        for axis in range(3):
            motions[axis, axis] = 1.0
            motions[3 + axis] = cross(np.eye(3)[axis][:, None], turned)
        frame = _by_set(apply_each(whitener, motions), count)
        frames = [frame * np.tile(self.run == run, 3) for run in range(model.frames)]
        return np.concatenate([own, *frames], axis=1)

    def _readings(self, places: Places, closed: Configuration) -> tuple[Array, Array, IntArray]:
        """Points (3, D A) in the base frame, rotation (3, 3, D A) of frames, states (D A,)."""
        rows, (first, inverse) = self.model.rows, self.model.states
        count = places.count
        state = (np.arange(count)[:, None] * first.size + inverse[self.kept]).reshape(-1)
        turn = places.rotation[:, :, self.run].transpose(0, 1, 3, 2).reshape(3, 3, -1)
        nest = self._each(rows.nest, count)
        arm = rotate(closed.poses.rotation[:, :, state], nest)
        on = np.tile(rows.on_platform[self.kept], count)
        return np.where(on, closed.poses.position[:, state] + arm, nest), turn, state

    def _over_states(self, columns: Array) -> Array:
        """(..., D) -> (..., M D), set after set."""
        return np.repeat(columns, self.model.states[0].size, axis=-1)

    def _each(self, columns: Array, count: int) -> Array:
        """Usable ones of (..., N) for every set, (..., D A)."""
        return np.tile(columns[..., self.kept], count)


def drawn_readings(model: Model, state: State, draws: list[tuple[int, ...]]) -> tuple[Array, Array]:
    """Machines drawn from the priors, and what is read of them with the rows' own noise.

    Parameters
    ----------
    model : Model
        Of the geometry alone.
    state : State
        Its frames are those of every set.
    draws : list of D seeds
        A set is drawn by its own seed: the same whatever the others are.

    Returns
    -------
    parameters (P, D), position (3, N, D) in mm

    Raises
    ------
    BadInput
        Where a machine within the tolerances does not close at a pose.
    """
    many, rows, machine = Many(model), model.rows, model.machine
    places = Places.around(model.start(state.frame_rotation, state.frame_position), len(draws))
    noise = np.empty((3, rows.count, len(draws)))
    for draw, seed in enumerate(draws):
        generator = np.random.default_rng(seed)
        off = generator.standard_normal(machine.nominal.size)
        places.parameters[:, draw] += machine.prior_sigma * off
        noise[:, :, draw] = rows.in_mm(generator.standard_normal((rows.count, 3)).T)
    closed = many.closed(places, model.nominal_configuration)
    if not many.closing(closed).all():
        raise BadInput(
            f"a {machine.name} within its tolerances does not close at a pose of the run",
            remedy="Choose poses farther from the ends of what it reaches, or smaller tolerances",
        )
    position = np.repeat(rows.position[:, :, None], len(draws), axis=2)
    position[:, many.kept] = many.seen(places, closed) + noise[:, many.kept]
    return places.parameters, position


def _by_set(columns: Array, count: int) -> Array:
    """(..., 3, D A) -> (D, ..., 3 A)."""
    apart = columns.reshape(*columns.shape[:-1], count, -1)
    turned = np.moveaxis(apart, -2, 0)
    return np.ascontiguousarray(turned.reshape(*turned.shape[:-2], -1))
