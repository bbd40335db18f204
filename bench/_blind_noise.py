"""Noise as stations have it: other than the readings state, with the same variance where it can.

ar:0.5     successive readings of a run err alike by this coefficient (Ornstein and Uhlenbeck)
walk:0.3   white noise and a walk whose steps are this part of sigma
visit:1    white noise and every pose displaced as a whole by this many sigma an axis
t:5        Student's t of so many degrees of freedom, scaled to the stated variance
scale:1.3  so many times what is stated
nest:1.6   so many times in one nest of the platform, the first that is read
along:1.5  so many times along the beam
range:0.6  noise beside what is stated, of so many sigma at a metre, growing with range
added:1    noise beside the covariances that a tracker states, of so many of the usual sigma
"""

from collections.abc import Callable

import numpy as np

from mocks.physics.bodies import body_named
from mocks.simulate.run import SimulatedRun

Vector = np.ndarray
Draw = Callable[[SimulatedRun, float, np.random.Generator], Vector]


def noisy(quiet: SimulatedRun, condition: str, sigma_mm: float, seed: int) -> Vector:
    """Readings (R, 3) of a run without noise under a condition; raises ValueError for no such one.

    Parameters
    ----------
    quiet : SimulatedRun
        The same campaign with next to no noise.
    condition : str
        As in the module's text.
    sigma_mm : float
        What the readings state.
    seed : int
    """
    name, _, amount = condition.partition(":")
    if name not in CONDITIONS:
        raise ValueError(f"no noise {condition!r}; known: {', '.join(CONDITIONS)}")
    rng = np.random.default_rng([seed, 11])
    read = np.flatnonzero(quiet.layout.reading)
    xyz = quiet.xyz.copy()
    xyz[read] += sigma_mm * CONDITIONS[name](quiet, float(amount), rng)
    return xyz


def _autoregressive(run: SimulatedRun, rho: float, rng: np.random.Generator) -> Vector:
    drawn = rng.standard_normal((int(run.layout.reading.sum()), 3))
    for row in range(1, len(drawn)):
        drawn[row] = rho * drawn[row - 1] + np.sqrt(1.0 - rho**2) * drawn[row]
    return drawn


def _walk(run: SimulatedRun, step: float, rng: np.random.Generator) -> Vector:
    white, steps = rng.standard_normal((2, int(run.layout.reading.sum()), 3))
    return np.asarray(white + step * np.cumsum(steps, axis=0))


def _visit(run: SimulatedRun, size: float, rng: np.random.Generator) -> Vector:
    read = run.layout.reading
    names = np.asarray(run.layout.pose)[read]
    stops = np.concatenate([[0], np.cumsum(names[1:] != names[:-1])])
    moved = size * rng.standard_normal((int(stops[-1]) + 1, 3))[stops]
    on_platform = [name in _platform(run) for name in np.asarray(run.layout.nest)[read]]
    white = rng.standard_normal(moved.shape)
    return np.asarray(white + moved * np.asarray(on_platform)[:, None])


def _platform(run: SimulatedRun) -> set[str]:
    return set(body_named(run.plan.machine).around.platform_nests)


def _student(run: SimulatedRun, freedom: float, rng: np.random.Generator) -> Vector:
    drawn = rng.standard_t(freedom, (int(run.layout.reading.sum()), 3))
    return np.asarray(drawn / np.sqrt(freedom / (freedom - 2.0)))


def _scaled(run: SimulatedRun, ratio: float, rng: np.random.Generator) -> Vector:
    return np.asarray(ratio * rng.standard_normal((int(run.layout.reading.sum()), 3)))


def _nest(run: SimulatedRun, ratio: float, rng: np.random.Generator) -> Vector:
    drawn = _scaled(run, 1.0, rng)
    names = np.asarray(run.layout.nest)[run.layout.reading]
    return np.asarray(drawn * np.where(names == nest_of(run), ratio, 1.0)[:, None])


def nest_of(run: SimulatedRun) -> str:
    """The nest of the platform that is read first."""
    names = np.asarray(run.layout.nest)[run.layout.reading]
    return next(str(name) for name in names if name in _platform(run))


def _along(run: SimulatedRun, ratio: float, rng: np.random.Generator) -> Vector:
    drawn = _scaled(run, 1.0, rng)
    points = run.xyz[run.layout.reading]
    beam = points / np.linalg.norm(points, axis=1)[:, None]
    return np.asarray(drawn + (ratio - 1.0) * np.sum(drawn * beam, axis=1)[:, None] * beam)


def _ranged(run: SimulatedRun, size: float, rng: np.random.Generator) -> Vector:
    metres = np.linalg.norm(run.xyz[run.layout.reading], axis=1) / 1000.0
    white, beside = rng.standard_normal((2, metres.size, 3))
    return np.asarray(white + size * metres[:, None] * beside)


def widened(run: SimulatedRun, condition: str, sigma_mm: float, seed: int) -> Vector:
    """Readings (R, 3) with white noise beside their own, by condition ``added``."""
    rng, size = np.random.default_rng([seed, 11]), float(condition.partition(":")[2])
    read, xyz = np.flatnonzero(run.layout.reading), run.xyz.copy()
    xyz[read] += sigma_mm * _scaled(run, size, rng)
    return xyz


CONDITIONS: dict[str, Draw] = {
    "ar": _autoregressive,
    "walk": _walk,
    "visit": _visit,
    "t": _student,
    "scale": _scaled,
    "nest": _nest,
    "along": _along,
    "range": _ranged,
}
