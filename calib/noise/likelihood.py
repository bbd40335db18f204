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
from calib.scaled import Scaled

WANDERED = 10.0
"""Time constant of what wanders, in lengths of a run: within the run it does not fade."""
FEWEST = 12
"""Components from which the scatter of a group of readings is asked for, and of all others."""


class Likelihood:
    """-log L of one problem, without its constant, by the components' names and logs of sizes."""

    def __init__(self, problem: LinearProblem, taking: Taking) -> None:
        every = np.vstack([problem.jacobian, problem.residual])
        self._rows = np.ascontiguousarray(every.reshape(len(every), 3, -1).transpose(2, 1, 0))
        """Derivatives and, last, the residual, reading by reading (A, 3, p + 1)."""
        self._products = _products(self._rows)
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
        whitening = Whitening(self.taking, noise)
        if noise.stretched:
            products, log_det = self._products / noise.scale**2, whitening.log_det
        else:
            products, log_det = whitening.products(self._rows)
        normal, step = self._step(products)
        log_normal = 2.0 * float(np.sum(np.log(np.diag(normal.factor)) - np.log(normal.scale)))
        square = float(products[-1, -1]) - float(step @ step)
        return 0.5 * (log_det + log_normal + square)

    def left(self, noise: Noise) -> tuple[Array, Array]:
        """Residuals (3, A) of the fit with some noise, made white, and its G (p, 3, A)."""
        rows = Whitening(self.taking, noise).by_reading(self._rows)
        normal, step = self._step(_products(rows))
        absorbed = normal.half_solved(rows[..., :-1].reshape(-1, step.size).T)
        residual = rows[..., -1].reshape(-1) - step @ absorbed
        absorbed = absorbed.reshape(step.size, -1, 3).swapaxes(1, 2)
        return residual.reshape(-1, 3).T, np.ascontiguousarray(absorbed)

    def residual(self, noise: Noise) -> Array:
        """The residuals (3, A) alone."""
        rows = Whitening(self.taking, noise).by_reading(self._rows)
        normal, step = self._step(_products(rows))
        return np.asarray((rows[..., -1] - rows[..., :-1] @ normal.half_solved_back(step)).T)

    def _step(self, products: Array) -> tuple[Scaled, Array]:
        """N = L L^T, and L^-1 times the slope, of products (p + 1, p + 1) of white columns."""
        normal = products[:-1, :-1] + np.diag(self._precision)
        scaled = Scaled.of(normal, least=1e-12)
        return scaled, scaled.half_solved(products[:-1, -1] - self._pull)


def _products(rows: Array) -> Array:
    """Columns (A, 3, k) times one another, (k, k)."""
    flat = rows.reshape(-1, rows.shape[2])
    return np.asarray(flat.T @ flat)


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
    at = np.array(logs)

    def value(move: Array) -> float:
        return likelihood.at(parts, tuple(at + move))

    centre = value(np.zeros(size))
    single = np.array([value(move) + value(-move) - 2.0 * centre for move in moves])
    curvature = np.diag(single)
    for i in range(size):
        for j in range(i):
            both = value(moves[i] + moves[j]) + value(-moves[i] - moves[j]) - 2.0 * centre
            curvature[i, j] = curvature[j, i] = 0.5 * (both - single[i] - single[j])
    curvature /= width**2
    values, vectors = np.linalg.eigh(curvature)
    variance = np.where(values > 1e-9, 1.0 / np.maximum(values, 1e-9), np.inf)
    seen = [float(np.sum(row[row != 0] ** 2 * variance[row != 0])) for row in sums @ vectors]
    return np.asarray(np.sqrt(seen), dtype=np.float64)
