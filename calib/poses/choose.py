"""Choice of measurement poses: greedy, then exchange, by rank-six updates of all candidates.

For every candidate k two small matrices are kept, G_k = A_k C A_k^T and H_k = A_k C W C A_k^T,
with C the covariance of the poses chosen so far (:mod:`calib.poses.information`). Adding k lowers
the predicted error tr(C W) by tr((I + G_k)^-1 H_k) (I-optimality, Woodbury) and raises the
log-determinant of the information by log det(I + G_k) (D-optimality). When pose s is added,
C' = C - U U^T with U = C A_s^T L^-T, L L^T = I + G_s, and all G_k and H_k follow from one product
A_k [U, C W U]. Removing a pose is the same with the signs of I - G_s.
"""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from calib.arrays import Array, IntArray
from calib.poses.information import covariance

Criterion = Literal["I", "D"]
REFRESH = 40
"""Updates after which everything is computed anew, against rounding."""
CRITICAL = 1e-4
"""Smallest eigenvalue of I - G with which a pose is removed by an update."""


@dataclass(eq=False)
class Candidates:
    """All candidates, and what each would add to the poses chosen so far.

    Parameters
    ----------
    rows : (p, m, N)
        Whitened rows A of every candidate, pose last.
    base : (p, p)
        Information M0 before any pose is measured.
    weight : (p, p)
        W of the predicted error.
    criterion : "I" or "D"
    """

    rows: Array
    base: Array
    weight: Array
    criterion: Criterion
    chosen: list[int] = field(default_factory=list)
    information: Array = field(init=False)
    C: Array = field(init=False)
    CW: Array = field(init=False)
    G: Array = field(init=False)
    H: Array = field(init=False)
    updates: int = 0

    def __post_init__(self) -> None:
        self.information = self.base.copy()
        self.refresh()

    @property
    def m(self) -> int:
        """Rows of each pose."""
        return int(self.rows.shape[1])

    def refresh(self) -> None:
        """Compute covariance, G and H anew from the chosen poses."""
        p, m, count = self.rows.shape
        self.information = self.base.copy()
        for k in self.chosen:
            self.information += self.rows[:, :, k] @ self.rows[:, :, k].T
        self.C = covariance(self.information)
        self.CW = self.C @ self.weight
        flat = self.rows.reshape(p, m * count)
        U = (self.C @ flat).reshape(p, m, count)
        self.G = np.einsum("pin,pjn->ijn", self.rows, U)
        if self.criterion == "I":
            V = (self.CW @ U.reshape(p, -1)).reshape(p, m, count)
            self.H = np.einsum("pin,pjn->ijn", self.rows, V)
        else:
            self.H = np.zeros((m, m, 0))
        self.updates = 0

    def gains(self, *, spread: bool = False) -> Array:
        """What each candidate would gain if added, (N,); -inf for those already chosen.

        ``spread`` asks for the gain in determinant, whatever the criterion.
        """
        if self.criterion == "I" and not spread:
            gain = _trace_of_solution(self.G, self.H, 1.0)
        else:
            gain = _log_determinant(self.G, 1.0)
        gain[self.chosen] = -np.inf
        return gain

    def losses(self) -> Array:
        """What the removal of each chosen pose would cost, in the order of ``chosen``."""
        G = self.G[:, :, self.chosen]
        if self.criterion == "I":
            return _trace_of_solution(G, self.H[:, :, self.chosen], -1.0)
        return -_log_determinant(G, -1.0)

    def add(self, k: int) -> None:
        """Measure at candidate k as well."""
        self.chosen.append(k)
        self._update(k, 1.0)

    def remove(self, k: int) -> None:
        """Leave out candidate k again."""
        self.chosen.remove(k)
        self._update(k, -1.0)

    def _update(self, k: int, sign: float) -> None:
        self.updates += 1
        A = self.rows[:, :, k]
        S = np.eye(self.m) + sign * self.G[:, :, k]
        early = len(self.chosen) * self.m <= 1.2 * self.C.shape[0]
        if early or self.updates >= REFRESH or np.linalg.eigvalsh(S)[0] < CRITICAL:
            # Where unknowns rest on the prior, before or after, differences of large numbers
            # would lose what is small.
            self.refresh()
            return
        self.information += sign * (A @ A.T)
        U = np.linalg.solve(np.linalg.cholesky(S), (self.C @ A).T).T
        Y = self.CW @ U
        p, m, count = self.rows.shape
        both = np.concatenate([U, Y], axis=1).T @ self.rows.reshape(p, m * count)
        T = both[:m].reshape(m, m, count)
        self.G -= sign * np.einsum("ain,ajn->ijn", T, T)
        if self.criterion == "I":
            Q = U.T @ self.weight @ U
            Z = both[m:].reshape(m, m, count) - 0.5 * sign * np.einsum("ab,bin->ain", Q, T)
            change = np.einsum("ain,ajn->ijn", T, Z)
            self.H -= sign * (change + change.swapaxes(0, 1))
        self.C = self.C - sign * (U @ U.T)
        self.CW = self.C @ self.weight


def _cholesky(G: Array, sign: float) -> Array:
    """Lower triangle L (m, m, N) of I + sign G; not finite where that is not positive."""
    L = sign * G
    m = len(L)
    for i in range(m):
        L[i, i] += 1.0
    for k in range(m):
        if k:
            L[k:, k] -= np.einsum("ijn,jn->in", L[k:, :k], L[k, :k])
        L[k, k] = np.sqrt(L[k, k])
        L[k + 1 :, k] /= L[k, k]
    return L


def _log_determinant(G: Array, sign: float) -> Array:
    """Log det(I + sign G), (N,); -inf where not positive."""
    with np.errstate(invalid="ignore", divide="ignore"):
        L = _cholesky(G, sign)
        value = 2.0 * sum(np.log(L[i, i]) for i in range(len(L)))
    return np.where(np.isfinite(value), value, -np.inf)


def _trace_of_solution(G: Array, H: Array, sign: float) -> Array:
    """Trace of (I + sign G)^-1 H, (N,); inf where I + sign G is not positive."""
    m = len(G)
    with np.errstate(invalid="ignore", divide="ignore"):
        L = _cholesky(G, sign)
        X = np.zeros_like(L)
        for j in range(m):
            X[j, j] = 1.0 / L[j, j]
            for i in range(j + 1, m):
                X[i, j] = -np.einsum("kn,kn->n", L[i, j:i], X[j:i, j]) / L[i, i]
        # trace(X H X^T), X the inverse of the triangle
        value = np.zeros(G.shape[2])
        for i in range(m):
            Hx = np.einsum("abn,bn->an", H[: i + 1, : i + 1], X[i, : i + 1])
            value += np.einsum("an,an->n", X[i, : i + 1], Hx)
    return np.where(np.isfinite(value), value, np.inf)


def greedy(candidates: Candidates, count: int, *, spread_first: bool) -> IntArray:
    """Add the best candidate until ``count`` are chosen; the chosen indices, in order.

    Without priors the predicted error means nothing before every unknown has been seen; with
    ``spread_first`` the poses are therefore chosen by determinant and left to :func:`exchange`.
    """
    while len(candidates.chosen) < count:
        candidates.add(int(np.argmax(candidates.gains(spread=spread_first))))
    return np.array(candidates.chosen)


def exchange(candidates: Candidates, rounds: int) -> int:
    """Swap a chosen pose for a better candidate until no swap helps; number of swaps.

    The pose whose loss costs least is tried first. At most ``rounds`` removals are tried.
    """
    candidates.refresh()
    swaps, settled = 0, set[int]()
    for _ in range(rounds):
        losses = candidates.losses()
        order = [candidates.chosen[i] for i in np.argsort(losses)]
        trial = next((k for k in order if k not in settled), None)
        if trial is None:
            break
        candidates.remove(trial)
        best = int(np.argmax(candidates.gains()))
        candidates.add(best)
        if best == trial:
            settled.add(trial)
        else:
            swaps += 1
            settled = set()
    return swaps
