"""How likely readings are with noise of given components: the restricted likelihood.

With the whitened derivatives J of everything fitted, priors' precision Lambda, the residual e of
the fit and a covariance C of the noise, the fitted unknowns integrated out (Patterson and Thompson
1971; the priors beside it as in a mixed model),

    -2 log L = log det C + log det (J C^-1 J^T + Lambda) + min over d of
               |C^-1/2 (e - J^T d)|^2 + (D + d)^T Lambda (D + d)

where D is how far the fit is from the priors' means (Lambda D = J e at its optimum).
"""

import math
from collections.abc import Sequence

import numpy as np

from calib.arrays import Array
from calib.evidence.problem import LinearProblem
from calib.noise.component import Noise, Taking
from calib.noise.scatter import Scatter
from calib.noise.whitening import Whitening
from calib.scaled import Scaled, normal_matrix

WANDERED = 10.0
"""Time constant of what wanders, in lengths of a run: within the run it does not fade."""
FEWEST = 12
"""Components from which the scatter of a group of readings is asked for, and of all others."""


class Likelihood:
    """-log L of one problem, without its constant, by the components' names and logs of sizes."""

    def __init__(self, problem: LinearProblem, taking: Taking) -> None:
        self._residual = problem.residual.reshape(1, 3, -1)
        self._jacobian = problem.jacobian.reshape(problem.jacobian.shape[0], 3, -1)
        self._precision = problem.prior_precision
        self._pull = problem.held_back
        self.taking = taking
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
        self.uneven = _askable(taking)
        for part in self.uneven:
            usual = _usual_size(taking.scatter, part)
            lowest, highest = (0.1, 30.0) if taking.scatter.is_added(part) else (0.2, 20.0)
            self.low[part], self.high[part] = np.log(lowest * usual), np.log(highest * usual)

    def at(self, parts: Sequence[str], logs: Sequence[float]) -> float:
        """-log L with components of some sizes."""
        return self.of(self.noise(parts, logs))

    def noise(self, parts: Sequence[str], logs: Sequence[float]) -> Noise:
        """Components of some sizes, within what is sensible."""
        clipped = {
            part: float(np.clip(log, self.low[part], self.high[part]))
            for part, log in zip(parts, logs, strict=True)
        }
        scale = math.exp(clipped.get("scale", 0.0))
        visit = math.exp(clipped["visit"]) if "visit" in clipped else 0.0
        own = tuple((part, math.exp(log)) for part, log in clipped.items() if part in self.uneven)
        by_row = "successive" in clipped or "walk-by-row" in clipped
        step = clipped.get("walk", clipped.get("walk-by-row"))
        if step is not None:
            gap, tau = self.taking.usual_gap_s, WANDERED * self.taking.span_s
            reach = math.exp(2.0 * step) * tau / (2.0 * gap)
            wide = scale * math.sqrt(1.0 + reach)
            part = reach / (1.0 + reach)
            return Noise(wide, tau, part, visit, by_row, math.exp(step), own)
        log_tau = clipped.get("correlated", clipped.get("successive"))
        share = 1.0 / (1.0 + math.exp(-clipped["share"])) if "share" in clipped else 1.0
        tau = 0.0 if log_tau is None else math.exp(log_tau)
        return Noise(scale, tau, share, visit, by_row, scatter=own)

    def of(self, noise: Noise) -> float:
        """-log L with some noise."""
        whitening, jacobian, residual = self._whitened(noise)
        normal = Scaled.of(normal_matrix(jacobian, self._precision), least=1e-12)
        step = normal.half_solved(jacobian @ residual - self._pull)
        log_normal = 2.0 * float(np.sum(np.log(np.diag(normal.factor)) - np.log(normal.scale)))
        square = float(residual @ residual) - float(step @ step)
        return 0.5 * (whitening.log_det + log_normal + square)

    def left(self, noise: Noise) -> tuple[Array, Array]:
        """Residuals (3, A) of the fit with some noise, made white, and its G (p, 3, A)."""
        _, jacobian, residual = self._whitened(noise)
        normal = Scaled.of(normal_matrix(jacobian, self._precision), least=1e-12)
        absorbed = normal.half_solved(jacobian)
        step = normal.half_solved(jacobian @ residual - self._pull)
        return (residual - step @ absorbed).reshape(3, -1), absorbed.reshape(step.size, 3, -1)

    def _whitened(self, noise: Noise) -> tuple[Whitening, Array, Array]:
        whitening = Whitening(self.taking, noise)
        jacobian = whitening.apply(self._jacobian).reshape(self._jacobian.shape[0], -1)
        return whitening, jacobian, whitening.apply(self._residual).reshape(-1)


def _askable(taking: Taking) -> tuple[str, ...]:
    """What the scatter of these readings may hang on: of several alike the first."""
    held, found, known = taking.held(), [], set()
    for name in taking.scatter.names:
        group = taking.scatter.groups.get(name)
        if group is not None:
            inside = float(held[group].sum())
            if inside < FEWEST or held.sum() - inside < FEWEST or group.tobytes() in known:
                continue
            known.add(group.tobytes())
        found.append(name)
    return tuple(found)


def _usual_size(scatter: Scatter, part: str) -> float:
    """Size that does about as much as what is stated."""
    if not scatter.is_added(part):
        return 1.0
    each = np.einsum("iin->in", scatter.added[part])
    return float(1.0 / np.sqrt(np.median(each[each > 0.0])))


def spread(
    likelihood: Likelihood, parts: tuple[str, ...], logs: tuple[float, ...], sums: Array
) -> Array:
    """Standard deviations of ``sums`` (k, n) of the logs by second differences; inf where flat."""
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
    seen = [float(np.sum(row[row != 0] ** 2 * variance[row != 0])) for row in sums @ vectors]
    return np.asarray(np.sqrt(seen), dtype=np.float64)
