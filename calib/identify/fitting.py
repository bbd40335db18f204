"""A model fitted to its readings: values, uncertainties, floors, and the readings left out."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from calib.arrays import Array, BoolArray, parts_of
from calib.digits import length
from calib.evidence.problem import LinearProblem
from calib.identify.optimum import optimise
from calib.identify.readings import MASKED, BadReading, strays
from calib.identify.starting import bad_reading, begin
from calib.identify.taking import noise_variances, taken
from calib.mechanism.rigid import euler_rates, to_euler
from calib.model.prediction import Model
from calib.model.state import Linearised, State
from calib.noise import WHITE, Component, Noise, Taking, Whitening


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
    gross : tuple of BadReading
        Of the bad ones, those where no nest can be, whatever the effects.
    settled : bool
        False where the fit still improved when its steps ran out: the best point is the answer.
    noise, whitening : Noise, Whitening or None
        Components of the noise that the optimum counts with, and what frees the accepted readings
        of what they share; None where the readings are taken as independent, as stated.
    components_of_noise : tuple of Component
        What is known of the noise: values with uncertainties.
    inflation : float
        Median ratio of the uncertainties with this noise and as stated, over what is identified.
    """

    model: Model
    linear: Linearised
    accepted: BoolArray
    bad: tuple[BadReading, ...]
    step_covariance: Array
    steps: int
    gross: tuple[BadReading, ...]
    settled: bool = True
    noise: Noise = WHITE
    whitening: Whitening | None = None
    components_of_noise: tuple[Component, ...] = ()
    inflation: float = 1.0

    def whiten(self, columns: Array) -> Array:
        """Columns (..., 3, N) in stated sigmas for the accepted readings, white, (..., 3 A)."""
        chosen = columns if self.accepted.all() else columns[..., self.accepted]
        if self.whitening is not None:
            chosen = self.whitening.apply(chosen)
        return np.ascontiguousarray(chosen.reshape(*columns.shape[:-2], -1))

    def freed(self, columns: Array) -> Array:
        """Columns (..., 3 A) of the accepted readings in stated sigmas, made white."""
        if self.whitening is None:
            return columns
        shape = columns.shape
        return self.whitening.apply(columns.reshape(*shape[:-1], 3, -1)).reshape(shape)

    @cached_property
    def jacobian(self) -> Array:
        """Whitened derivatives of the accepted readings, (p, 3 A)."""
        return self.whiten(self.linear.jacobian)

    @cached_property
    def whitened(self) -> Array:
        """Accepted residuals in sigmas, made white, (3 A,)."""
        return self.whiten(self.linear.whitened)

    @property
    def taking(self) -> Taking:
        """How the accepted readings were taken."""
        return self.taking_of(self.accepted)

    def taking_of(self, kept: BoolArray) -> Taking:
        """How readings (N,) were taken."""
        return taken(self.linear, kept)

    @cached_property
    def prior_precision(self) -> Array:
        """1 / sigma^2 of the priors (p,)."""
        return 1.0 / self.model.prior**2

    @property
    def problem(self) -> LinearProblem:
        """The fit as a linear problem over its accepted readings."""
        return LinearProblem(
            self.whitened, self.jacobian, self.prior_precision, self._live, self._pull
        )

    @property
    def as_stated(self) -> LinearProblem:
        """The same in stated sigmas, whatever noise the readings share."""
        kept = self.accepted
        jacobian = self.linear.jacobian[:, :, kept].reshape(self.prior_precision.size, -1)
        residual = self.linear.whitened[:, kept].reshape(-1)
        return LinearProblem(residual, jacobian, self.prior_precision, self._live, self._pull)

    @property
    def _pull(self) -> Array:
        return np.asarray(self.prior_precision * self.model.deviation(self.linear.state))

    @property
    def _live(self) -> BoolArray | None:
        rows = self.model.rows
        return None if rows.sensed is None else rows.live[:, self.accepted].reshape(-1)

    @cached_property
    def values(self) -> Array:
        """Unknowns (p,) in the order of ``model.names``; frames as x, y, z, rx, ry, rz."""
        state = self.linear.state
        frames = [frame_values(state, run) for run in range(self.model.frames)]
        own = (state.parameters[self.model.free], *state.effects, state.setup)
        return np.concatenate([*own, *frames])

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
        """Sum of squared residuals in stated sigmas over accepted readings."""
        return float(np.sum(self.linear.whitened[:, self.accepted] ** 2))

    @cached_property
    def cost(self) -> float:
        """What the fit has made least: squared residuals, made white, and the priors' part."""
        prior = self.prior_precision * self.model.deviation(self.linear.state) ** 2
        return float(self.whitened @ self.whitened + np.sum(prior))

    @cached_property
    def trace_hat(self) -> float:
        """tr H of the fit with priors: unknowns that the data determine."""
        return float(np.sum(1.0 - np.diag(self.covariance) * self.prior_precision))

    @property
    def components(self) -> int:
        """Number of components that the accepted readings hold."""
        return int(self.model.rows.components[self.accepted].sum())

    @property
    def dof(self) -> float:
        """Components (3 for each point) - tr H."""
        return self.components - self.trace_hat

    @property
    def chi2_per_dof(self) -> float:
        """Chi-square per degree of freedom."""
        return self.chi2 / self.dof if self.dof > 0 else float("nan")

    @cached_property
    def rms_mm(self) -> float:
        """RMS of the 3D distance between measured and predicted SMR centre.

        Over readings that say something in mm, of what they say: one component of a height. Nan
        where there are none.
        """
        return self.rms_of(self.accepted)

    def rms_of(self, which: BoolArray) -> float:
        """The same of some readings (N,)."""
        told = self.model.rows.in_millimetres
        which = which & told.any(axis=0)
        residual = (self.linear.residual * told)[:, which]
        return _root_mean(float(np.sum(residual**2)), int(which.sum()))

    @cached_property
    def noise_floor_mm(self) -> float:
        """What ``rms_mm`` would be for a perfect model: sqrt(mean tr(Sigma - J C J^T))."""
        return self.floor_of(self.accepted)

    def floor_of(self, which: BoolArray) -> float:
        """The same of some fitted readings (N,)."""
        which = which & self.model.rows.in_millimetres.any(axis=0)
        total = noise_variance(self, which) - self.explained(self.step_covariance, which)
        return _root_mean(max(total, 0.0), int(which.sum()))

    def explained(self, covariance: Array, which: BoolArray) -> float:
        """Sum of tr(J C J^T) in mm^2 over readings: variance of the prediction itself."""
        total = 0.0
        for part in parts_of(which):
            jacobian = self.model.rows.in_mm(self.linear.jacobian[:, :, part], part)
            flat = jacobian.reshape(jacobian.shape[0], -1)
            total += float(np.sum(flat * (covariance @ flat)))
        return total


def noise_variance(fit: Fit, which: BoolArray) -> float:
    """Sum over readings of the variance of their noise, whatever they share of it, mm^2."""
    rows, noise = fit.model.rows, fit.noise
    own = noise_variances(fit.linear, noise, which)
    total = float(np.sum(np.where(rows.in_millimetres[:, which], own, 0.0)))
    if noise.visit > 0.0:
        usual = noise.visit * np.array([axis.usual_error for axis in rows.machine.axes])
        moved = rows.in_mm(
            (fit.linear.situation.actuator_columns * rows.on_platform)[..., which], which
        )
        total += float(np.sum((usual[:, None, None] * moved) ** 2))
    return total


def _root_mean(squares: float, count: int) -> float:
    return float(np.sqrt(squares / count)) if count else float("nan")


def with_noise(fit: Fit, noise: Noise, components: tuple[Component, ...] = ()) -> Fit:
    """The same readings fitted with what their noise really is."""
    if noise == WHITE:
        return fit
    whitening = Whitening(fit.taking, noise)
    found = optimise(fit.model, fit.linear, fit.accepted, whitening)
    return replace(
        fit,
        linear=found.linear,
        step_covariance=found.covariance,
        noise=noise,
        components_of_noise=components,
        steps=fit.steps + found.steps,
        settled=fit.settled and found.settled,
        whitening=whitening,
        inflation=_inflation(fit, found.covariance),
    )


def _inflation(white: Fit, step_covariance: Array) -> float:
    before = np.sqrt(np.diag(white.step_covariance))
    known = before < 0.5 * white.model.prior
    after = np.sqrt(np.diag(step_covariance))
    return float(np.median(after[known] / before[known])) if known.any() else 1.0


def frame_values(state: State, run: int) -> Array:
    """Base frame of a run in the tracker frame as x, y, z (mm), rx, ry, rz (rad)."""
    angles = to_euler(state.frame_rotation[:, :, run])
    return np.concatenate([state.frame_position[:, run], angles])


def fit(
    model: Model,
    *,
    start: State | None = None,
    masked: Sequence[int] = (),
    gross: Sequence[BadReading] | None = None,
) -> Fit:
    """Fit a model to its readings.

    Parameters
    ----------
    model : Model
    start : State, optional
        Where to begin: another fit of the same model, or a start for nonlinear unknowns.
    masked : sequence of int
        Readings (indices) that the operator has masked.
    gross : sequence of BadReading, optional
        Those of an earlier fit of the same readings, where ``start`` brings its frames: readings
        where no nest can be are then not looked for again.

    Raises
    ------
    BadInput
        If the readings cannot tie the frames, or do not belong to this machine.
    """
    bad = [bad_reading(model, row, MASKED) for row in masked]
    allowed = model.usable.copy()
    allowed[list(masked)] = False
    if gross is not None and start is not None:
        linear = model.linearise(start)
    else:
        linear, gross = begin(model, allowed)
        if start is not None:
            linear = model.linearise(_with_frames(start, linear.state))
    bad += gross
    accepted = allowed.copy()
    accepted[[reading.row for reading in bad]] = False
    # Where it begins is handed over: its derivatives are let go with the first step.
    begun, steps = [linear], 0
    del linear
    for _ in range(3):
        optimum = optimise(model, begun.pop(), accepted)
        linear, steps = optimum.linear, steps + optimum.steps
        begun.append(linear)
        found = strays(
            linear.whitened, linear.jacobian, 1.0 / model.prior**2, accepted, model.rows.components
        )
        if not found:
            break
        for row in found:
            bad.append(bad_reading(model, row, f"stray: {miss_in_words(linear, row)}"))
            accepted[row] = False
    covariance, settled = optimum.covariance, optimum.settled
    return Fit(model, linear, accepted, tuple(bad), covariance, steps, tuple(gross), settled)


def miss_in_words(linear: Linearised, row: int) -> str:
    """How far a reading is from what it should be."""
    rows = linear.situation.rows
    miss = float(np.linalg.norm(linear.residual[:, row]))
    if rows.sensed is not None and rows.sensed.angular[row]:
        return f"{1e6 * miss:.3g} urad from what it should read"
    return f"{length(miss)} from where it should be"


def _with_frames(start: State, begun: State) -> State:
    """Take the frames of the alignment where a start brings none."""
    if start.frame_position.shape == begun.frame_position.shape:
        return start
    return replace(start, frame_rotation=begun.frame_rotation, frame_position=begun.frame_position)


def _frames_as_angles(model: Model, state: State, covariance: Array) -> Array:
    """Covariance with each frame's rotation vector replaced by rx, ry, rz."""
    turn = np.eye(covariance.shape[0])
    first = covariance.shape[0] - 6 * model.frames
    for run in range(model.frames):
        at = first + 6 * run + 3
        turn[at : at + 3, at : at + 3] = euler_rates(state.frame_rotation[:, :, run])
    return turn @ covariance @ turn.T
