"""What a model that is already known says of readings that it has not seen.

Nothing is fitted but, where it is asked for, the base frame of each run, and how it moves where the
model says that the tracker drifted. A residual in sigmas is
then e = n - J d with n the noise of the new readings, d the error of the model's unknowns with
covariance C. Without a refitted frame its covariance is I + J C J^T. With one, the part along the
frame's columns F is taken out of both,

    V = (I - P) + (I - P) J C J^T (I - P),    P = F^T (F F^T)^-1 F,

and that is what the new readings are judged by: what noise *and* the model's own uncertainty allow.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.evidence.tails import log_tail
from calib.identify.readings import BadReading
from calib.identify.starting import begin
from calib.mechanism.rigid import euler_rates, from_euler
from calib.model.prediction import Model
from calib.model.state import Linearised, State
from calib.scaled import Scaled, normal_matrix

FRAME_STEPS = 20
LOST = 1e-10
"""Part of the largest direction below which readings say nothing of it (a drift in no time)."""
FRAME_SETTLED = 1e-9
"""Fall of chi-square per reading below which a frame has settled."""


@dataclass(frozen=True, eq=False)
class Known:
    """Unknowns of a model as an earlier fit has left them.

    ``values`` (p,) in the order of ``model.names``, frames as x, y, z, rx, ry, rz (anything where
    they are refitted), and their covariance (p, p).
    """

    values: Array
    covariance: Array


@dataclass(frozen=True, eq=False)
class Prediction:
    """Readings against a model that has not seen them.

    Attributes
    ----------
    model, linear
        The model, and its linearisation at the known values.
    accepted : (N,) bool
        Readings that are predicted.
    bad : tuple of BadReading
        Those where no nest can be.
    refitted : bool
        Whether the frames were fitted to these readings.
    spread : (q, 3, N)
        Whitened change of each reading with each of q independent unit errors of the model.
    frame : (m, 3, N)
        Whitened columns of all that was refitted, orthonormal over the accepted readings; none
        otherwise.
    """

    model: Model
    linear: Linearised
    accepted: BoolArray
    bad: tuple[BadReading, ...]
    refitted: bool
    spread: Array
    frame: Array

    @cached_property
    def covariance(self) -> Array:
        """What noise and model allow each residual (3, 3, N), mm2, tracker frame."""
        unit = np.eye(3)[:, :, None] * self.model.rows.live[None]
        own = np.einsum("qin,qjn->ijn", self.spread, self.spread)
        taken = np.einsum("qin,qjn->ijn", self.frame, self.frame)
        factors = self.model.rows.unwhitener
        return np.asarray(np.einsum("ikn,kln,jln->ijn", factors, unit + own - taken, factors))

    @cached_property
    def covariance_in_base(self) -> Array:
        """The same along the axes of the base frame."""
        turn = self.linear.situation.frame_rotation
        return np.asarray(np.einsum("kin,kln,ljn->ijn", turn, self.covariance, turn))

    @cached_property
    def residual_in_base(self) -> Array:
        """Measured minus predicted (3, N), mm, along the axes of the base frame."""
        turn = self.linear.situation.frame_rotation
        return np.asarray(np.einsum("kin,kn->in", turn, self.linear.residual))

    @cached_property
    def chi2(self) -> float:
        """e^T V^-1 e over accepted readings, by Woodbury's identity."""
        e = self.linear.whitened[:, self.accepted].reshape(-1)
        spread = self.spread[:, :, self.accepted].reshape(self.spread.shape[0], -1)
        along = spread @ e
        inner = np.eye(spread.shape[0]) + spread @ spread.T
        return float(e @ e - along @ np.linalg.solve(inner, along))

    @property
    def dof(self) -> int:
        """Components of accepted readings, less those of the refitted frames."""
        held = int(self.model.rows.components[self.accepted].sum())
        return held - int(self.frame.shape[0])

    @property
    def log_p(self) -> float:
        """log of the probability that noise and the model's uncertainty leave as much."""
        return float(log_tail(np.array([self.chi2]), float(self.dof))[0])


def predict(model: Model, known: Known, *, refit: bool) -> Prediction:
    """Predict readings from known unknowns; with ``refit`` the frames are fitted to them.

    Raises
    ------
    BadInput
        If too few readings stand where the machine's nests can be, or it does not close.
    """
    begun, bad = begin(model, model.usable)
    accepted = model.usable.copy()
    accepted[[reading.row for reading in bad]] = False
    state = _state(model, known, begun.state if refit else None)
    linear = model.linearise(state)
    refit = refit and model.frames > 0
    placed = _placing(model)
    if refit:
        linear = _placed(model, linear, accepted, placed)
    covariance = _by_rotation_vectors(model, linear.state, known.covariance)
    if refit:
        covariance[placed, :] = covariance[:, placed] = 0.0
    spread = np.tensordot(_root(covariance), linear.jacobian, axes=(0, 0))
    frame = np.zeros((0, *linear.whitened.shape))
    if refit:
        frame = _orthonormal(linear.jacobian[placed], accepted)
        inner = np.tensordot(spread[:, :, accepted], frame[:, :, accepted], axes=([1, 2], [1, 2]))
        spread = spread - np.tensordot(inner, frame, axes=1)
    return Prediction(model, linear, accepted, tuple(bad), refit, spread, frame)


def shift_of_frames(found: Prediction) -> tuple[float, Array]:
    """How much better these readings would fit if the frames were where they want them.

    Returns
    -------
    log_p : float
        log of the probability that chance does as much.
    step : (6, K)
        The shift of each frame, mm, and its rotation vector, rad.
    """
    frames = 6 * found.model.frames
    if not frames:
        return 0.0, np.zeros((6, 0))
    columns = found.linear.jacobian[-frames:, :, found.accepted].reshape(frames, -1)
    normal = Scaled.of(normal_matrix(columns, np.zeros(frames)))
    e = found.linear.whitened[:, found.accepted].reshape(-1)
    # What the model's own uncertainty may do to the frames is no shift: it is taken as noise.
    spread = found.spread[:, :, found.accepted].reshape(found.spread.shape[0], -1)
    step = normal.solve(columns @ e, 0.0)
    moved = normal.inverse() @ columns @ spread.T
    allowed = normal.inverse() + moved @ moved.T
    chi2 = float(step @ np.linalg.solve(allowed, step))
    log_p = float(log_tail(np.array([chi2]), float(frames))[0])
    return log_p, step.reshape(found.model.frames, 6).T


def _state(model: Model, known: Known, begun: State | None) -> State:
    """The known values as a state; frames of ``begun`` where they are to be refitted."""
    count, frames = model.free.size, model.frames
    if begun is None:
        placed = known.values[known.values.size - 6 * frames :].reshape(frames, 6).T
        begun = model.start(from_euler(*placed[3:]), placed[:3])
    parameters = begun.parameters.copy()
    parameters[model.free] = known.values[:count]
    sizes = [len(group) for group in model.unknowns]
    ends = count + np.cumsum([0, *sizes])
    effects = tuple(known.values[a:b] for a, b in pairwise(ends))
    setup = known.values[ends[-1] : ends[-1] + begun.setup.size]
    return replace(
        begun, parameters=parameters, effects=effects, setup=setup, near=begun.configuration
    )


def _placing(model: Model) -> IntArray:
    """Unknowns that say where a tracker stands, and how it moves meanwhile."""
    first = model.free.size
    names: list[int] = []
    for effect, group in zip(model.effects, model.unknowns, strict=True):
        if effect.of_its_run and effect.kind == "measurement" and not effect.ends_with_run:
            names += range(first, first + len(group))
        first += len(group)
    every = len(model.names)
    return np.array([*names, *range(every - 6 * model.frames, every)], dtype=np.intp)


def _placed(model: Model, linear: Linearised, accepted: BoolArray, placed: IntArray) -> Linearised:
    """Least squares of where the tracker stands, alone."""
    cost = float(np.sum(linear.whitened[:, accepted] ** 2))
    for _ in range(FRAME_STEPS):
        columns = linear.jacobian[placed][:, :, accepted].reshape(placed.size, -1)
        slope = columns @ linear.whitened[:, accepted].reshape(-1)
        step = np.zeros(linear.jacobian.shape[0])
        normal = Scaled.of(normal_matrix(columns, np.zeros(placed.size)))
        step[placed] = normal.solve(slope, LOST)
        linear = model.linearise(model.moved(linear.state, step))
        now = float(np.sum(linear.whitened[:, accepted] ** 2))
        if abs(cost - now) < FRAME_SETTLED * accepted.sum():
            break
        cost = now
    return linear


def _by_rotation_vectors(model: Model, state: State, covariance: Array) -> Array:
    """Covariance of a step, from that of values with rx, ry, rz."""
    back = np.eye(covariance.shape[0])
    first = covariance.shape[0] - 6 * model.frames
    for run in range(model.frames):
        at = first + 6 * run + 3
        rates = euler_rates(state.frame_rotation[:, :, run])
        back[at : at + 3, at : at + 3] = np.linalg.pinv(rates)
    return np.asarray(back @ covariance @ back.T)


def _root(covariance: Array) -> Array:
    """L (p, q) with C = L L^T; a file's rounded correlations may make C a little indefinite."""
    scale = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    inverse = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0.0)
    sizes, axes = np.linalg.eigh(covariance * inverse[:, None] * inverse)
    kept = sizes > 1e-12
    return np.asarray(scale[:, None] * axes[:, kept] * np.sqrt(sizes[kept]))


def _orthonormal(columns: Array, accepted: BoolArray) -> Array:
    """Columns (m, 3, N) combined so that they are orthonormal over the accepted readings.

    Directions of which these say nothing are left out.
    """
    chosen = columns[:, :, accepted].reshape(columns.shape[0], -1)
    return np.tensordot(_whitening(chosen @ chosen.T), columns, axes=1)


def _whitening(normal: Array) -> Array:
    """W (q, m) with W N W^T = 1 for a normal matrix N (m, m), of its directions that count."""
    scale = np.sqrt(np.diag(normal))
    inverse = np.divide(1.0, scale, out=np.zeros_like(scale), where=scale > 0.0)
    sizes, axes = np.linalg.eigh(normal * inverse[:, None] * inverse)
    kept = sizes > LOST * sizes[-1]
    return np.asarray((axes[:, kept] / np.sqrt(sizes[kept])).T * inverse)
