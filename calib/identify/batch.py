"""Many sets of readings of one run fitted together: Monte-Carlo studies, coverage, power.

The sets differ in what was read, not in what was commanded: all begin at one linearisation (the
nominal machine), whose normal matrix is factorised once. Over the tolerances derivatives change by
about a hundredth, so its step comes within some standard uncertainties of every optimum. There each
set gets derivatives of its own, which serve for two steps and the uncertainties: the first comes
within thousandths, the second far below. A set for which this does not hold (a stray, a misfit,
readings in another hole) is fitted by itself, by :func:`calib.identify.fit`.
"""

from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, BoolArray
from calib.chance import f_rarer_than
from calib.identify.fitting import fit
from calib.identify.readings import FALSE_ALARM
from calib.identify.starting import slack_of
from calib.mechanism.configuration import Configuration
from calib.mechanism.rigid import euler_rates, to_euler
from calib.model.many import Many, Places
from calib.model.prediction import Model
from calib.model.state import Linearised, State
from calib.scaled import Scaled, normal_matrix

TOGETHER = 64
"""Sets that are worked on at a time: their derivatives stay near the processor."""
NEAR = 1e-2
"""Predicted fall of chi-square by the last step, above which a set goes on by itself."""
PLACED = 0.8
"""Part of the slack of a good reading up to which nothing is asked about its place."""


@dataclass(frozen=True, eq=False)
class Draws:
    """Fits of D sets of readings.

    Attributes
    ----------
    values, sigmas : (p, D)
        Unknowns in the order of ``model.names``, frames as x, y, z, rx, ry, rz, and their
        standard uncertainties.
    chi2 : (D,)
        Sum of squared residuals in stated sigmas over the accepted readings.
    alone : (D,) bool
        Sets that were fitted by themselves.
    """

    values: Array
    sigmas: Array
    chi2: Array
    alone: BoolArray


def fit_draws(model: Model, position: Array, start: State) -> Draws:
    """Fit D sets of readings that a model's rows would have had.

    Parameters
    ----------
    model : Model
        Its rows say what was commanded and how well was read.
    position : (3, N, D)
        What was read, mm, in the frames of the rows.
    start : State
        Frames near those of every set; the machine begins nominal.

    Raises
    ------
    BadInput
        What a fit of one set alone raises.
    """
    count = position.shape[2]
    found = Draws(
        np.empty((model.prior.size, count)), np.empty((model.prior.size, count)),
        np.empty(count), np.ones(count, dtype=bool),
    )  # fmt: skip
    if Many.possible(model):
        linear = model.linearise(model.start(start.frame_rotation, start.frame_position))
        together = _Together(model, linear)
        for begin in range(0, count, TOGETHER):
            together.fit(position, slice(begin, min(begin + TOGETHER, count)), found)
    for draw in np.flatnonzero(found.alone):
        own = fit(Model(replace(model.rows, position=position[:, :, draw]), model.effects))
        found.values[:, draw], found.sigmas[:, draw] = own.values, own.sigmas
        found.chi2[draw] = own.chi2
    return found


class _Together:
    """What sets of readings share: rows, the first linearisation and its factors."""

    def __init__(self, model: Model, linear: Linearised) -> None:
        self.model, self.linear, self.many = model, linear, Many(model)
        self.precision = 1.0 / model.prior**2
        self.flat = linear.jacobian[:, :, self.many.kept].reshape(model.prior.size, -1)
        self.inverse = Scaled.of(normal_matrix(self.flat, self.precision)).inverse()
        self.slack = PLACED * slack_of(model, linear)[self.many.kept]

    def fit(self, position: Array, which: slice, found: Draws) -> None:
        """Fit some sets, and say which of them have to go on by themselves."""
        many, linear = self.many, self.linear
        read = position[:, many.kept, which]
        expected = (self.model.rows.position - linear.residual)[:, many.kept, None]
        apart = np.sqrt(np.sum((read - expected) ** 2, axis=0))
        good = np.all(apart < self.slack[:, None], axis=0)
        slope = self.flat @ many.whitened(read - expected).T
        places = Places.around(linear.state, read.shape[2])
        places = places.moved(self.model.free, self.inverse @ slope)
        closed = many.closed(places, linear.situation.closed)
        own = _Own(self, places, closed)
        own.step(places, many.whitened(read - many.seen(places, closed)))
        closed = many.closed(own.places, closed)
        own.step(own.places, many.whitened(read - many.seen(own.places, closed)))
        good &= many.closing(closed)
        found.values[:, which] = own.values()
        found.sigmas[:, which] = own.sigmas()
        found.chi2[which] = np.sum(own.residual**2, axis=1)
        found.alone[which] = ~(good & (own.fall < NEAR) & ~own.with_strays())

    def pull(self, places: Places) -> Array:
        """What the priors hold against (p, D)."""
        free = self.model.free
        off = places.parameters[free] - self.model.centre[: free.size, None]
        pull = np.zeros((self.precision.size, places.count))
        pull[: free.size] = self.precision[: free.size, None] * off
        return pull


class _Own:
    """D sets with derivatives of their own.

    ``places`` (of the sets), ``residual`` (D, 3 A) in sigmas there, and the ``fall`` (D,) of
    chi-square and priors that was predicted for the step to it.
    """

    places: Places
    residual: Array
    fall: Array

    def __init__(self, shared: _Together, places: Places, closed: Configuration) -> None:
        self.model, self.pull = shared.model, shared.pull
        self.components = shared.model.rows.components[shared.many.kept]
        self.jacobian = shared.many.jacobian(places, closed)
        normal = self.jacobian @ self.jacobian.transpose(0, 2, 1)
        diagonal = np.arange(normal.shape[1])
        normal[:, diagonal, diagonal] += shared.precision
        scale = 1.0 / np.sqrt(normal[:, diagonal, diagonal])
        both = scale[:, :, None] * scale[:, None, :]
        self.covariance = np.linalg.inv(normal * both) * both

    def step(self, places: Places, whitened: Array) -> None:
        """Take a Gauss-Newton step from where the residuals (D, 3 A) are those."""
        slope = (self.jacobian @ whitened[:, :, None])[:, :, 0] - self.pull(places).T
        step = (self.covariance @ slope[:, :, None])[:, :, 0]
        self.fall = np.sum(step * slope, axis=1)
        self.places = places.moved(self.model.free, step.T)
        self.residual = whitened - (step[:, None, :] @ self.jacobian)[:, 0]

    def values(self) -> Array:
        """Unknowns (p, D)."""
        count = self.fall.size
        angles = to_euler(self.places.rotation.reshape(3, 3, -1)).reshape(3, -1, count)
        frames = np.concatenate([self.places.position, angles])
        frames = frames.transpose(1, 0, 2).reshape(-1, count)
        return np.concatenate([self.places.parameters[self.model.free], frames])

    def sigmas(self) -> Array:
        """Standard uncertainties (p, D), of frames by rx, ry, rz."""
        sigmas = np.sqrt(np.einsum("dpp->pd", self.covariance))
        for run in range(self.model.frames):
            at = slice(*(self.model.free.size + 6 * run + np.array([3, 6])))
            rates = euler_rates(self.places.rotation[:, :, run])
            spread = np.einsum("ijd,djk,ikd->id", rates, self.covariance[:, at, at], rates)
            sigmas[at] = np.sqrt(spread)
        return np.asarray(sigmas)

    def with_strays(self) -> BoolArray:
        """Sets (D,) with a reading that may be a stray, as :mod:`calib.identify.readings` says."""
        count, size = self.fall.size, self.components.size
        columns = self.jacobian.reshape(count, -1, 3, size)
        spread = (self.covariance @ self.jacobian).reshape(columns.shape)
        hat = np.empty((count, size, 3, 3))
        for i in range(3):
            for j in range(3):
                hat[:, :, i, j] = np.einsum("dpn,dpn->dn", columns[:, :, i], spread[:, :, j])
        residual = self.residual.reshape(count, 3, size).transpose(0, 2, 1)
        freed = np.linalg.solve(np.eye(3) - hat, residual[..., None])[..., 0]
        drop = np.sum(residual * freed, axis=2)
        total = np.sum(self.residual**2, axis=1)
        dof = self.components.sum() - np.einsum("dnii->d", hat)
        return np.array(
            [
                f_rarer_than(
                    FALSE_ALARM / size, 3, max(free - 3.0, 1.0),
                    most / 3.0 / max((whole - most) / max(free - 3.0, 1.0), 1.0),
                )
                for most, whole, free in zip(drop.max(axis=1), total, dof, strict=True)
            ]
        )  # fmt: skip
