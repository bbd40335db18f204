"""Sizes of components of noise at which the readings are likeliest, in few likelihoods.

Each likelihood goes through all readings, so what is known of its shape is kept: between sizes that
were asked, log L is taken for a sum of 1, t, cosh t and sinh t of the log t of the size, through
the four nearest; of several sizes together its curvature goes from one question to the next, and is
learnt from the steps that are taken (Broyden, Fletcher, Goldfarb and Shanno).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from calib.arrays import Array
from calib.noise.likelihood import Likelihood

GRID = 6
"""Sizes that are asked for at first, over all that is sensible."""
WORTH = 0.02
"""Rise of log L that is worth one more likelihood."""
FAINT = 0.3
"""Rise of log L below which a component is not tried again beside others."""
REFINED, STEPS = 8, 8
"""Likelihoods of one size beyond the grid, and steps of several together, at most."""
WIDEST = 0.1
"""Difference of logs that gives a slope, at most; less where half a standard deviation is less."""
HOPE = 4.0
"""Rise of log L that is hoped for, over what is expected."""
EDGE, FAR_WORSE, NARROW = 2.0, 5.0, 0.5
"""Rises of log L, and a distance, that make a best size unsure (see :func:`_unsure`)."""
FLAT = 1e-2
"""Least curvature of log L that is taken for one."""


@dataclass(frozen=True, eq=False)
class Sizes:
    """Components, logs of their sizes, -log L there, and its second derivatives (n, n) by logs."""

    parts: tuple[str, ...]
    logs: tuple[float, ...]
    value: float
    curvature: Array = field(default_factory=lambda: np.zeros((0, 0)))
    fresh: bool = False

    def without(self, likelihood: Likelihood, part: str) -> "Sizes":
        """The others alone, as they are."""
        kept = [k for k, name in enumerate(self.parts) if name != part]
        parts = tuple(self.parts[k] for k in kept)
        logs = tuple(self.logs[k] for k in kept)
        return Sizes(parts, logs, likelihood.at(parts, logs), self.curvature[np.ix_(kept, kept)])


def joined(likelihood: Likelihood, now: Sizes, part: str) -> Sizes:
    """One component more at its most likely size, the others as they are."""
    parts = (*now.parts, part)
    log, value, curved = along(
        lambda one: likelihood.at(parts, (*now.logs, one)),
        likelihood.low[part],
        likelihood.high[part],
        now.value - FAINT,
    )
    curvature = np.zeros((len(parts), len(parts)))
    curvature[:-1, :-1] = now.curvature
    curvature[-1, -1] = curved
    return Sizes(parts, (*now.logs, log), value, curvature, fresh=True)


def settled(likelihood: Likelihood, near: Sizes) -> Sizes:
    """All components together at their most likely sizes."""
    if not near.parts:
        return near
    low = np.array([likelihood.low[part] for part in near.parts])
    high = np.array([likelihood.high[part] for part in near.parts])

    def value(logs: Array) -> float:
        return likelihood.at(near.parts, logs.tolist())

    start = np.clip(near.logs, low, high)
    logs, least, curvature = together(
        value, start, near.value, near.curvature, (low, high), joining=near.fresh
    )
    return Sizes(near.parts, tuple(logs.tolist()), least, curvature)


def along(
    value: Callable[[float], float], low: float, high: float, below: float
) -> tuple[float, float, float]:
    """Where a function of one number is least, to ``WORTH``: place, value, second derivative.

    What is far from falling ``below`` is not searched any further.
    """
    at = list(np.linspace(low, high, GRID))
    values = [value(one) for one in at]
    curvature = FLAT
    for _ in range(REFINED):
        place, fall, curvature = _between(np.array(at), np.array(values))
        if fall < WORTH:
            beside = _unsure(at, values) if min(values) - EDGE < below else None
            if beside is None:
                break
            place = beside
        elif min(values) - HOPE * fall > below:
            break
        at.append(place)
        values.append(value(place))
    best = int(np.argmin(values))
    return at[best], values[best], curvature


def _unsure(at: Sequence[float], values: Sequence[float]) -> float | None:
    """A place beside the best one, where nothing near it was asked and all that was is far worse.

    Or where the best is at an end: what is between it and the next is then not known at all.
    """
    order = np.argsort(at)
    x, y = np.array(at)[order], np.array(values)[order]
    best = int(np.argmin(y))
    beside = [k for k in (best - 1, best + 1) if 0 <= k < x.size]
    next_best = min(beside, key=lambda k: float(y[k]))
    if len(beside) == 2 and y[next_best] - y[best] < FAR_WORSE:
        return None
    place = float(x[best] + 0.2 * (x[next_best] - x[best]))
    return place if np.min(np.abs(x[beside] - x[best])) > NARROW else None


def _between(at: Array, values: Array) -> tuple[float, float, float]:
    """Where about the least of some values more is to be had, how much, and how they curve there.

    The function is taken for a sum of 1, t, cosh t and sinh t through the least and its neighbours.
    """
    order = np.argsort(at)
    x, y = at[order], values[order]
    best = int(np.argmin(y))
    low, high = max(best - 1, 0), min(best + 1, x.size - 1)
    away = np.abs(x - x[best])
    away[low : high + 1] = -1.0
    near = np.argsort(away, kind="stable")[:4]

    def terms(t: Array) -> Array:
        t = t - x[best]
        return np.stack([np.ones_like(t), t, np.cosh(t) - 1.0, np.sinh(t) - t], axis=-1)

    weights = np.linalg.lstsq(terms(x[near]), y[near] - y[best], rcond=1e-12)[0]
    fine = np.linspace(x[low], x[high], 201)
    told = terms(fine) @ weights
    least = int(np.argmin(told))
    inner = int(np.clip(least, 1, fine.size - 2))
    bend = (told[inner - 1] - 2.0 * told[inner] + told[inner + 1]) / (fine[1] - fine[0]) ** 2
    return float(fine[least]), float(-told[least]), max(float(bend), FLAT)


def together(
    value: Callable[[Array], float],
    at: Array,
    least: float,
    curvature: Array,
    box: tuple[Array, Array],
    *,
    joining: bool,
) -> tuple[Array, float, Array]:
    """Where a function of n numbers is least, to ``WORTH``: place, value, second derivatives.

    Parameters
    ----------
    value : callable
    at : (n,)
        Where the search begins.
    least : float
        Value there.
    curvature : (n, n)
        What is known of the second derivatives.
    box : (n,), (n,)
        Least and largest numbers.
    joining : bool
        Whether those of the last number with the others are not known.
    """
    low, high = box
    slope, curvature = _slope(value, at, least, curvature, box, joining=joining)
    damping = 0.0
    for _ in range(STEPS):
        damped = curvature + damping * np.diag(np.diag(curvature))
        step = np.clip(at - np.clip(np.linalg.solve(damped, slope), -1.0, 1.0), low, high) - at
        fall = -float(slope @ step + 0.5 * step @ curvature @ step)
        if fall < WORTH:
            break
        reached = value(at + step)
        if reached >= least:
            damping = max(10.0 * damping, 1.0)
            continue
        damping = 0.1 * damping if damping > 0.1 else 0.0
        at, least = at + step, reached
        before = slope
        slope, _ = _slope(value, at, least, curvature, box)
        curvature = _learnt(curvature, step, slope - before)
    return at, least, curvature


def _slope(
    value: Callable[[Array], float],
    at: Array,
    least: float,
    curvature: Array,
    box: tuple[Array, Array],
    *,
    joining: bool = False,
) -> tuple[Array, Array]:
    """First derivatives (n,), from one value beside for each number, and second ones.

    ``joining``: second derivatives by the last number are found as well.
    """
    bend = np.diag(curvature)
    width = np.minimum(WIDEST, 0.5 / np.sqrt(bend))
    width = np.where(at + width > box[1], -width, width)
    beside = np.array([value(at + one) for one in np.diag(width)])
    if joining:
        last = np.zeros_like(at)
        last[-1] = width[-1]
        curvature = curvature.copy()
        on = 2.0 if not box[0][-1] <= at[-1] - width[-1] <= box[1][-1] else -1.0
        third = (value(at + on * last) - least) / on - (beside[-1] - least)
        curvature[-1, -1] = max(2.0 * third / ((on - 1.0) * width[-1] ** 2), FLAT)
        for k in range(at.size - 1):
            other = np.zeros_like(at)
            other[k] = width[k]
            both = value(at + last + other) - beside[k] - beside[-1] + least
            curvature[k, -1] = curvature[-1, k] = both / (width[k] * width[-1])
        curvature = _valley(curvature)
    slope = (beside - least) / width - 0.5 * np.diag(curvature) * width
    return np.asarray(slope), curvature


def _valley(curvature: Array) -> Array:
    """The same without directions in which it does not rise."""
    size = np.sqrt(np.diag(curvature))
    values, vectors = np.linalg.eigh(curvature / size[:, None] / size)
    lifted = (vectors * np.maximum(np.abs(values), 0.05)) @ vectors.T
    return np.asarray(lifted * size[:, None] * size)


def _learnt(curvature: Array, step: Array, change: Array) -> Array:
    """Second derivatives as far as a step has shown them; as before where it shows no valley."""
    seen, along = float(step @ change), curvature @ step
    told = float(step @ along)
    if seen <= 0.1 * told:
        return curvature
    return np.asarray(curvature - np.outer(along, along) / told + np.outer(change, change) / seen)
