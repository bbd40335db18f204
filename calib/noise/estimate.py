"""Which components of noise the readings demand: restricted maximum likelihood.

With the whitened derivatives J of everything fitted, priors' precision Lambda, the residual e of
the fit and a covariance C of the noise, the fitted unknowns integrated out (Patterson and Thompson
1971; the priors beside it as in a mixed model),

    -2 log L = log det C + log det (J C^-1 J^T + Lambda) + min over d of
               |C^-1/2 (e - J^T d)|^2 + (D + d)^T Lambda (D + d)

where Lambda D = J e at the optimum of the fit. Components join one by one while the likelihood
rises by enough; so noise that a missing effect imitates is not taken for one where that effect's
columns are among J.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.chance import chi2_above
from calib.evidence.problem import LinearProblem
from calib.noise.component import WHITE, Noise, Taking
from calib.noise.whitening import Whitening
from calib.scaled import Scaled, normal_matrix

DEMANDED = 1.5
"""Rise of the log likelihood from which a component counts in judging what else is missing."""
RESCALED = 4.8
"""The same of the scale of the stated sigmas: these are trusted unless clearly wrong."""
FAINT = 0.3
"""The same below which a component is not tried again beside others."""
SHARED = 2.0
"""The same of a white part beside the correlated one."""
FADING, WANDERING = ("correlated", "successive"), ("walk", "walk-by-row")
"""What goes on in time, or from row to row: it fades, or wanders without end, where some fades."""
TIED = (*FADING, *WANDERING)
"""One or the other."""
PARTS = (*TIED, "visit", "scale")
SAID = {"successive": "correlated", "walk-by-row": "walk"}
WANDERED = 10.0
"""Time constant of what wanders, in lengths of a run: within the run it does not fade."""


@dataclass(frozen=True)
class Component:
    """A component of the noise.

    ``name`` correlated, walk, visit or scale; ``value`` s, stated sigmas from one reading to the
    next, usual errors, or a ratio; ``sigma`` standard uncertainty of the value; ``p_value`` of
    having none.
    """

    name: str
    value: float
    sigma: float
    p_value: float


@dataclass(frozen=True)
class Found:
    """What noise the readings demand; ``gain`` is the rise of the log likelihood by all of it."""

    noise: Noise = WHITE
    gain: float = 0.0
    components: tuple[Component, ...] = ()


class _Likelihood:
    """-log L of one problem, without its constant."""

    def __init__(self, problem: LinearProblem, taking: Taking) -> None:
        self._residual = problem.residual.reshape(1, 3, -1)
        self._jacobian = problem.jacobian.reshape(problem.jacobian.shape[0], 3, -1)
        self._precision = problem.prior_precision
        self._pull = problem.jacobian @ problem.residual
        self._taking = taking
        shortest = np.log(0.2 * taking.usual_gap_s)
        self.low = {
            "correlated": shortest, "successive": shortest, "visit": np.log(0.02),
            "walk": np.log(0.02), "walk-by-row": np.log(0.02), "scale": np.log(0.2), "share": -4.0,
        }  # fmt: skip
        longest = max(0.5 * taking.span_s, 2.0 * taking.usual_gap_s)
        self.high = {
            "correlated": np.log(longest), "successive": np.log(longest),
            "visit": np.log(10.0), "walk": np.log(3.0), "walk-by-row": np.log(3.0),
            "scale": np.log(20.0), "share": 6.0,
        }  # fmt: skip

    def at(self, parts: Sequence[str], logs: Sequence[float]) -> float:
        return self.of(self.noise(parts, logs))

    def noise(self, parts: Sequence[str], logs: Sequence[float]) -> Noise:
        clipped = {
            part: float(np.clip(log, self.low[part], self.high[part]))
            for part, log in zip(parts, logs, strict=True)
        }
        scale = math.exp(clipped.get("scale", 0.0))
        visit = math.exp(clipped["visit"]) if "visit" in clipped else 0.0
        by_row = "successive" in clipped or "walk-by-row" in clipped
        step = clipped.get("walk", clipped.get("walk-by-row"))
        if step is not None:
            gap, tau = self._taking.usual_gap_s, WANDERED * self._taking.span_s
            reach = math.exp(2.0 * step) * tau / (2.0 * gap)
            wide = scale * math.sqrt(1.0 + reach)
            return Noise(wide, tau, reach / (1.0 + reach), visit, by_row, math.exp(step))
        log_tau = clipped.get("correlated", clipped.get("successive"))
        share = 1.0 / (1.0 + math.exp(-clipped["share"])) if "share" in clipped else 1.0
        return Noise(scale, 0.0 if log_tau is None else math.exp(log_tau), share, visit, by_row)

    def of(self, noise: Noise) -> float:
        whitening = Whitening(self._taking, noise)
        jacobian = whitening.apply(self._jacobian).reshape(self._jacobian.shape[0], -1)
        residual = whitening.apply(self._residual).reshape(-1)
        normal = Scaled.of(normal_matrix(jacobian, self._precision), least=1e-12)
        step = normal.half_solved(jacobian @ residual - self._pull)
        log_normal = 2.0 * float(np.sum(np.log(np.diag(normal.factor)) - np.log(normal.scale)))
        square = float(residual @ residual) - float(step @ step)
        return 0.5 * (whitening.log_det + log_normal + square)


def estimate(problem: LinearProblem, taking: Taking, *, least: float = DEMANDED) -> Found:
    """Find the components of noise that the residual of a fit demands.

    Parameters
    ----------
    problem : LinearProblem
        A fit over A readings' three components (axis after axis), in stated sigmas.
    taking : Taking
    least : float
        Rise of the log likelihood that correlation and visits must bring.
    """
    likelihood = _Likelihood(problem, taking)
    needed = dict.fromkeys(PARTS, least) | {"scale": max(least, RESCALED)}
    now = white = _Sizes((), (), likelihood.of(WHITE))
    gains: dict[str, float] = {}
    left = [part for part in PARTS if part != "visit" or np.any(taking.visit >= 0)]
    if not taking.alike:
        left = [part for part in left if part not in TIED]
    while left:
        fading = [part for part in left if part not in WANDERING]
        offers = {part: _joined(likelihood, now, part) for part in fading}
        if any(now.value - offers[part].value > least for part in FADING if part in offers):
            offers |= {part: _joined(likelihood, now, part) for part in WANDERING}
        rise = {part: now.value - offer.value for part, offer in offers.items()}
        best = max(rise, key=lambda part: rise[part] - needed[part])
        if rise[best] <= needed[best]:
            break
        now, gains[best] = offers[best], rise[best]
        taken = TIED if best in TIED else (best,)
        left = [part for part in rise if part not in taken and rise[part] > FAINT]
    if set(FADING) & set(now.parts):
        wider = _joined(likelihood, now, "share")
        now = wider if now.value - wider.value > SHARED else now
    if not now.parts:
        return Found()
    noise = likelihood.noise(now.parts, now.logs)
    return Found(noise, white.value - now.value, _components(likelihood, now, gains))


@dataclass(frozen=True)
class _Sizes:
    """Components, logs of their sizes, and -log L there."""

    parts: tuple[str, ...]
    logs: tuple[float, ...]
    value: float


def _joined(likelihood: _Likelihood, now: _Sizes, part: str) -> _Sizes:
    """One component more, all at their most likely sizes."""
    parts = (*now.parts, part)
    low, high = likelihood.low[part], likelihood.high[part]
    grid = np.linspace(low, high, 6)
    values = [likelihood.at(parts, (*now.logs, one)) for one in grid]
    at = int(np.argmin(values))
    from scipy import optimize  # slow to import: only where noise is estimated

    found = optimize.minimize_scalar(
        lambda one: likelihood.at(parts, (*now.logs, float(one))),
        bounds=(float(grid[max(at - 1, 0)]), float(grid[min(at + 1, grid.size - 1)])),
        method="bounded",
        options={"xatol": 0.04, "maxiter": 9},
    )
    alone = _Sizes(parts, (*now.logs, float(found.x)), float(found.fun))
    if not now.parts or now.value - alone.value < FAINT:
        return alone

    def value(logs: Array) -> float:
        return likelihood.at(parts, logs.tolist())

    start = np.array(alone.logs)
    best: Array = optimize.fmin(
        value,
        start,
        initial_simplex=start + np.vstack([np.zeros(start.size), 0.3 * np.eye(start.size)]),
        xtol=0.03,
        ftol=0.03,
        maxfun=36,
        disp=False,
    )
    together = _Sizes(parts, tuple(best.tolist()), value(best))
    return together if together.value < alone.value else alone


def _components(
    likelihood: _Likelihood, now: _Sizes, gains: dict[str, float]
) -> tuple[Component, ...]:
    """Values with uncertainties from the curvature of log L, and p by the likelihood ratio."""
    spread = _spread(likelihood, now.parts, now.logs)
    noise = likelihood.noise(now.parts, now.logs)
    values = {
        "correlated": noise.tau_s,
        "successive": noise.tau_s,
        "walk": noise.step,
        "walk-by-row": noise.step,
        "visit": noise.visit,
        "scale": noise.narrow,
    }
    return tuple(
        Component(
            SAID.get(part, part),
            values[part],
            float(values[part] * spread[k]),
            _chance(gains[part]),
        )
        for k, part in enumerate(now.parts)
        if part in values
    )


def _chance(gain: float) -> float:
    """Probability of such a rise where there is none of it: chi-square of one, from its edge."""
    return float(0.5 * chi2_above(1.0, 2.0 * gain))


def _spread(likelihood: _Likelihood, parts: tuple[str, ...], logs: tuple[float, ...]) -> Array:
    """Standard deviations of the logs by second differences; inf where they are flat."""
    size, width = len(parts), 0.1
    moves = width * np.eye(size)
    centre = likelihood.at(parts, logs)
    at = np.array(logs)
    curvature = np.zeros((size, size))
    for i in range(size):
        ahead, back = (likelihood.at(parts, tuple(at + s * moves[i])) for s in (1.0, -1.0))
        curvature[i, i] = (ahead + back - 2.0 * centre) / width**2
        for j in range(i):
            corners = [
                s * t * likelihood.at(parts, tuple(at + s * moves[i] + t * moves[j]))
                for s in (1.0, -1.0)
                for t in (1.0, -1.0)
            ]
            curvature[i, j] = curvature[j, i] = sum(corners) / (4.0 * width**2)
    values, vectors = np.linalg.eigh(curvature)
    variance = np.where(values > 1e-9, 1.0 / np.maximum(values, 1e-9), np.inf)
    seen = [float(np.sum(row[row != 0] ** 2 * variance[row != 0])) for row in vectors]
    return np.asarray(np.sqrt(seen), dtype=np.float64)
