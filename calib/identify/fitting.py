"""Maximum likelihood over the readings: Gauss-Newton, damped where it is needed.

Minimised is chi2 + prior = sum |W_r (p_r - f_r(theta))|^2 + sum ((theta_i - c_i) / sigma_i)^2.
With the whitened Jacobian J (p, rows) and D = diag(1 / sigma^2) a step solves

    (J J^T + D) step = J e - D (theta - c),

scaled to a unit diagonal before the Cholesky factorisation: the priors keep it well conditioned,
and the frames, which have none, are seen by every reading.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy import linalg

from calib.arrays import Array, BoolArray
from calib.errors import BadInput
from calib.frames import align
from calib.identify.alignment import collinear, robust_align
from calib.identify.readings import BadReading, strays, wrong_place
from calib.mechanism.rigid import euler_rates, rotate, to_euler
from calib.mechanism.solve import forward
from calib.model.prediction import Linearised, Model, State

MAX_STEPS = 30
LEAST_FALL = 1e-3
"""Fall of chi-square below which nothing is gained by a better step."""
ENOUGH = 0.8
"""Part of a step at which the cost is least, above which the whole step is taken."""
MAJORITY = 0.3
"""Least part of a run's readings that must stand where the machine's nests can be."""
TOLERANCE = 1e-6
"""Steps end when the predicted fall of chi-square is below this, or below 1e-9 of it."""


@dataclass(frozen=True, eq=False)
class Fit:
    """A model at its optimum.

    Attributes
    ----------
    model, linear
        The model, and its linearisation at the optimum.
    accepted : (N,) bool
        Readings in the fit.
    bad : tuple of BadReading
        Readings excluded, with reasons; readings without a needed channel are not among them.
    step_covariance : (p, p)
        Of a step of all unknowns as :meth:`Model.moved` takes it: frames by rotation vectors.
    steps : int
        Gauss-Newton steps taken.
    """

    model: Model
    linear: Linearised
    accepted: BoolArray
    bad: tuple[BadReading, ...]
    step_covariance: Array
    steps: int

    @cached_property
    def jacobian(self) -> Array:
        """Whitened derivatives of the accepted readings, (p, 3 A)."""
        chosen = self.linear.jacobian[:, :, self.accepted]
        return chosen.reshape(chosen.shape[0], -1)

    @cached_property
    def whitened(self) -> Array:
        """Accepted residuals in sigmas, (3 A,)."""
        return self.linear.whitened[:, self.accepted].reshape(-1)

    @cached_property
    def prior_precision(self) -> Array:
        """1 / sigma^2 of the priors (p,)."""
        return 1.0 / self.model.prior**2

    @cached_property
    def values(self) -> Array:
        """Unknowns (p,) in the order of ``model.names``; frames as x, y, z, rx, ry, rz."""
        state = self.linear.state
        frames = [frame_values(state, run) for run in range(self.model.frames)]
        return np.concatenate([state.parameters[self.model.free], *state.effects, *frames])

    @cached_property
    def covariance(self) -> Array:
        """Covariance (p, p) of ``values``: frames by rx, ry, rz."""
        return _frames_as_angles(self.model, self.linear.state, self.step_covariance)

    @cached_property
    def sigmas(self) -> Array:
        """Standard uncertainties (p,) of ``values``."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def readings(self) -> int:
        """Number of accepted readings."""
        return int(self.accepted.sum())

    @cached_property
    def chi2(self) -> float:
        """Sum of squared residuals in sigmas over accepted readings."""
        return float(self.whitened @ self.whitened)

    @cached_property
    def trace_hat(self) -> float:
        """tr H of the fit with priors: unknowns that the data determine."""
        return float(np.sum(1.0 - np.diag(self.covariance) * self.prior_precision))

    @property
    def dof(self) -> float:
        """3 readings - tr H."""
        return 3.0 * self.readings - self.trace_hat

    @property
    def chi2_per_dof(self) -> float:
        """Chi-square per degree of freedom."""
        return self.chi2 / self.dof if self.dof > 0 else float("nan")

    @cached_property
    def rms_mm(self) -> float:
        """RMS of the 3D distance between measured and predicted SMR centre."""
        residual = self.linear.residual[:, self.accepted]
        return float(np.sqrt(np.mean(np.sum(residual**2, axis=0))))

    @cached_property
    def noise_floor_mm(self) -> float:
        """What ``rms_mm`` would be for a perfect model: sqrt(mean tr(Sigma - J C J^T))."""
        covariance = self.model.rows.covariance[:, :, self.accepted]
        total = np.einsum("iin->", covariance) - self.explained(self.step_covariance, self.accepted)
        return float(np.sqrt(max(total, 0.0) / self.readings))

    def explained(self, covariance: Array, which: BoolArray) -> float:
        """Sum of tr(J C J^T) in mm^2 over readings: variance of the prediction itself."""
        factors = np.linalg.inv(np.moveaxis(self.model.rows.whitener[:, :, which], -1, 0))
        jacobian = np.einsum("nij,pjn->pin", factors, self.linear.jacobian[:, :, which])
        flat = jacobian.reshape(jacobian.shape[0], -1)
        return float(np.sum(flat * (covariance @ flat)))


def frame_values(state: State, run: int) -> Array:
    """Base frame of a run in the tracker frame as x, y, z (mm), rx, ry, rz (rad)."""
    angles = to_euler(state.frame_rotation[:, :, run])
    return np.concatenate([state.frame_position[:, run], angles])


def fit(model: Model, *, start: State | None = None, masked: Sequence[int] = ()) -> Fit:
    """Fit a model to its readings.

    Parameters
    ----------
    model : Model
    start : State, optional
        Where to begin: another fit of the same model, or a start for nonlinear unknowns.
    masked : sequence of int
        Readings (indices) that the operator has masked.

    Raises
    ------
    BadInput
        If the readings cannot tie the frames, or do not belong to this machine.
    """
    bad = [_bad(model, row, "masked by the operator") for row in masked]
    allowed = model.usable.copy()
    allowed[list(masked)] = False
    linear, gross = begin(model, allowed)
    bad += gross
    accepted = allowed.copy()
    accepted[[reading.row for reading in bad]] = False
    if start is not None:
        linear = model.linearise(_with_frames(start, linear.state))
    steps = 0
    for _ in range(3):
        linear, covariance, taken = _optimise(model, linear, accepted)
        steps += taken
        found = strays(linear.whitened, linear.jacobian, 1.0 / model.prior**2, accepted)
        if not found:
            break
        for row in found:
            miss = float(np.linalg.norm(linear.residual[:, row]))
            bad.append(_bad(model, row, f"stray: {1000 * miss:.3g} um from where it should be"))
            accepted[row] = False
    return Fit(model, linear, accepted, tuple(bad), covariance, steps)


def _bad(model: Model, row: int, why: str) -> BadReading:
    return BadReading(row, int(model.rows.run[row]), int(model.rows.line[row]), why)


def _with_frames(start: State, begun: State) -> State:
    """Take the frames of the alignment where a start brings none."""
    if start.frame_position.shape == begun.frame_position.shape:
        return start
    return replace(start, frame_rotation=begun.frame_rotation, frame_position=begun.frame_position)


def begin(model: Model, allowed: BoolArray) -> tuple[Linearised, list[BadReading]]:
    """Start at the nominal machine, frames by rigid alignment; and readings in no such place.

    Raises
    ------
    BadInput
        If too few readings stand where the machine's nests can be.
    """
    base = model.base_points()
    state, linear = _aligned(model, base, allowed)
    slack = _slack(model, linear)
    apart = np.sqrt(np.sum(linear.residual**2, axis=0))
    if np.all(apart[allowed] < slack[allowed]):
        return linear, []
    state, bad = _aligned_robustly(model, base, allowed, slack)
    return model.linearise(state), bad


def _aligned(model: Model, base: Array, allowed: BoolArray) -> tuple[State, Linearised]:
    """Align all readings of each run."""
    rows = model.rows
    rotation, position = np.zeros((3, 3, model.frames)), np.zeros((3, model.frames))
    for run in range(model.frames):
        here = np.flatnonzero((rows.run == run) & allowed)
        if collinear(base[:, here]):
            raise BadInput(
                f"{here.size} readings, all on one line, cannot tie the tracker to the machine",
                place=rows.runs[run].source,
                remedy="Expected readings at three places at least that are not on one line",
            )
        rotation[:, :, run], position[:, run] = align(base[:, here], rows.position[:, here])
    state = model.start(rotation, position)
    return state, model.linearise(state)


def _aligned_robustly(
    model: Model, base: Array, allowed: BoolArray, slack: Array
) -> tuple[State, list[BadReading]]:
    """Align the majority of each run's readings, and name the others."""
    rows = model.rows
    rotation, position = np.zeros((3, 3, model.frames)), np.zeros((3, model.frames))
    bad: list[BadReading] = []
    for run in range(model.frames):
        here = np.flatnonzero((rows.run == run) & allowed)
        R, t, inside = robust_align(base[:, here], rows.position[:, here], slack[here])
        if inside.sum() < max(6, MAJORITY * here.size) and inside.sum() < here.size:
            raise BadInput(
                f"only {inside.sum()} of {here.size} readings are where a nest can be",
                place=rows.runs[run].source,
                remedy="Check the machine, the nests in run.toml and the units (mm)",
            )
        rotation[:, :, run], position[:, run] = R, t
        for row in here[~inside]:
            expected = _expected(model, int(row), R, t)
            bad.append(_bad(model, int(row), wrong_place(rows, int(row), expected, slack[row])))
    return model.start(rotation, position), bad


def _expected(model: Model, row: int, R: Array, t: Array) -> dict[str, Array]:
    """Where every nest of the run stood at one reading, by the nominal machine."""
    rows = model.rows
    header = rows.runs[rows.run[row]].header
    pose = forward(model.machine, rows.extension[:, [row]]).poses
    places = {
        name: pose.position[:, 0] + rotate(pose.rotation[:, :, 0], nest)
        for name, nest in header.platform_nests.items()
    }
    places.update(header.base_nests)
    return {name: R @ place + t for name, place in places.items()}


def _slack(model: Model, linear: Linearised) -> Array:
    """How far (N,) a good reading may be from the aligned nominal machine, mm.

    Six sigmas of what the tolerances can do, the alignment's share included, plus a millimetre
    for effects that nobody has modelled.
    """
    count = model.free.size
    factors = np.linalg.inv(np.moveaxis(model.rows.whitener, -1, 0))
    moved = np.einsum("nij,pjn->pin", factors, linear.jacobian[:count])
    moved *= model.machine.prior_sigma[model.free][:, None, None]
    spread = np.sqrt(np.sum(moved**2, axis=(0, 1)))
    noise = np.sqrt(np.einsum("iin->n", model.rows.covariance))
    return np.asarray(1.0 + 6.0 * (np.maximum(spread, np.median(spread)) + noise))


def _optimise(
    model: Model, linear: Linearised, accepted: BoolArray
) -> tuple[Linearised, Array, int]:
    """Damped Gauss-Newton; returns the optimum, the covariance of the unknowns and the steps."""
    precision = 1.0 / model.prior**2
    cost = _cost(model, linear, accepted, precision)
    damping = 0.0
    for taken in range(1, MAX_STEPS + 1):
        normal, slope, scale = _normal_equations(model, linear, accepted, precision)
        while True:
            factor = linalg.cho_factor(normal + damping * np.eye(scale.size), lower=True)
            step = scale * linalg.cho_solve(factor, slope)
            fall = float(step @ (slope / scale))
            if fall <= max(TOLERANCE, 1e-9 * cost):
                covariance = _inverse(normal) * scale[:, None] * scale
                return linear, covariance, taken - 1
            trial = _attempt(model, linear, step)
            if trial is not None:
                reached = _cost(model, trial, accepted, precision)
                trial, reached = _shortened(
                    model, linear, step, (trial, reached, cost - reached, fall), accepted, precision
                )
                if reached <= cost * (1.0 + 1e-12) or fall < LEAST_FALL:
                    break
            damping = max(10.0 * damping, 1e-4)
            if damping > 1e8:
                raise BadInput(
                    "the fit does not converge",
                    remedy="Check that the run belongs to this machine; see its residuals",
                )
        damping *= 0.1 if damping > 1e-6 else 0.0
        linear, cost = trial, reached
    raise BadInput(
        f"the fit has not converged in {MAX_STEPS} steps",
        remedy="Check that the run belongs to this machine; see its residuals",
    )


def _shortened(
    model: Model,
    linear: Linearised,
    step: Array,
    tried: tuple[Linearised, float, float, float],
    accepted: BoolArray,
    precision: Array,
) -> tuple[Linearised, float]:
    """Take less of a step that overshoots: a period may zigzag about its optimum for ever.

    Along the step the cost is c - 2 F t + a t^2 with F the predicted fall; a follows from the cost
    at t = 1, and the minimum is at F / a.
    """
    trial, reached, fallen, fall = tried
    best = fall / max(2.0 * fall - fallen, 1e-300)
    if best > ENOUGH or fall < LEAST_FALL:
        return trial, reached
    shorter = _attempt(model, linear, best * step)
    if shorter is None:
        return trial, reached
    cost = _cost(model, shorter, accepted, precision)
    return (shorter, cost) if cost < reached else (trial, reached)


def _attempt(model: Model, linear: Linearised, step: Array) -> Linearised | None:
    try:
        return model.linearise(model.moved(linear.state, step))
    except BadInput:  # the machine does not close there: a shorter step will
        return None


def _cost(model: Model, linear: Linearised, accepted: BoolArray, precision: Array) -> float:
    residual = linear.whitened[:, accepted]
    return float(np.sum(residual**2) + np.sum(precision * model.deviation(linear.state) ** 2))


def _normal_equations(
    model: Model, linear: Linearised, accepted: BoolArray, precision: Array
) -> tuple[Array, Array, Array]:
    """Normal matrix scaled to a unit diagonal, scaled slope, and the scale (p,)."""
    jacobian = linear.jacobian
    if not accepted.all():
        jacobian = jacobian[:, :, accepted]
    flat = jacobian.reshape(jacobian.shape[0], -1)
    normal = flat @ flat.T
    normal[np.diag_indices_from(normal)] += precision
    slope = flat @ linear.whitened[:, accepted].reshape(-1)
    slope -= precision * model.deviation(linear.state)
    scale = 1.0 / np.sqrt(np.diag(normal))
    return normal * scale[:, None] * scale, slope * scale, scale


def _inverse(matrix: Array) -> Array:
    factor = linalg.cho_factor(matrix, lower=True)
    return np.asarray(linalg.cho_solve(factor, np.eye(matrix.shape[0])))


def _frames_as_angles(model: Model, state: State, covariance: Array) -> Array:
    """Covariance with each frame's rotation vector replaced by rx, ry, rz."""
    turn = np.eye(covariance.shape[0])
    first = covariance.shape[0] - 6 * model.frames
    for run in range(model.frames):
        at = first + 6 * run + 3
        turn[at : at + 3, at : at + 3] = euler_rates(state.frame_rotation[:, :, run])
    return turn @ covariance @ turn.T
