"""A model fitted to its readings: values, uncertainties, floors, and the readings left out."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from calib.arrays import Array, BoolArray
from calib.evidence.problem import LinearProblem
from calib.identify.optimum import optimise
from calib.identify.readings import MASKED, BadReading, strays
from calib.identify.starting import bad_reading, begin
from calib.mechanism.rigid import euler_rates, to_euler
from calib.model.prediction import Model
from calib.model.state import Linearised, State


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
    """

    model: Model
    linear: Linearised
    accepted: BoolArray
    bad: tuple[BadReading, ...]
    step_covariance: Array
    steps: int
    gross: tuple[BadReading, ...]

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

    @property
    def problem(self) -> LinearProblem:
        """The fit as a linear problem over its accepted readings."""
        return LinearProblem(self.whitened, self.jacobian, self.prior_precision)

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
        jacobian = self.model.rows.in_mm(self.linear.jacobian[:, :, which], which)
        flat = jacobian.reshape(jacobian.shape[0], -1)
        return float(np.sum(flat * (covariance @ flat)))


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
    steps = 0
    for _ in range(3):
        linear, covariance, taken = optimise(model, linear, accepted)
        steps += taken
        found = strays(linear.whitened, linear.jacobian, 1.0 / model.prior**2, accepted)
        if not found:
            break
        for row in found:
            miss = float(np.linalg.norm(linear.residual[:, row]))
            bad.append(
                bad_reading(model, row, f"stray: {1000 * miss:.3g} um from where it should be")
            )
            accepted[row] = False
    return Fit(model, linear, accepted, tuple(bad), covariance, steps, tuple(gross))


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
