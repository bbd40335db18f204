"""A small machine-like problem with known truth: smooth geometry, frames, effects, structure."""

from dataclasses import dataclass

import numpy as np

from calib.evidence import (
    Candidate,
    Columns,
    Diagnosis,
    LinearProblem,
    Response,
    Variable,
    structure_candidates,
)
from calib.evidence.quadratic import Neighbours
from calib.unknown import Unknown

POSES = 45


@dataclass(frozen=True)
class Refitted:
    """A stage of the staircase that is all there from the start; any effect may be tried out."""

    effects: tuple
    holdout: float
    diagnosis: Diagnosis

    @property
    def doubtful(self):
        return frozenset(self.effects)


PRIOR = 0.5


class Lab:
    """``POSES`` readings of two components; geometry and frames are smooth in two coordinates."""

    def __init__(self, seed):
        rng = np.random.default_rng(seed)
        self.x, self.y = rng.uniform(-1, 1, (2, POSES))
        self.time = np.sort(rng.uniform(0, 1, POSES))
        self.warmth = np.sin(2.0 * self.time) + 0.1 * rng.normal(size=POSES)
        self.direction = rng.choice([-1.0, 1.0], (2, POSES))
        shapes = [np.ones(POSES), self.x, self.y, self.x * self.y, self.x**2, self.y**2]
        self.geometry = np.concatenate([self.two(4.0 * shape) for shape in shapes])
        self.precision = np.full(12, 1.0 / PRIOR**2)
        self.precision[[0, 1]] = 0.0
        self.effects = [
            self.effect("pitch", self.two(self.x**3)),
            self.effect(
                "backlash", np.array([self.one(d, k) for k, d in enumerate(self.direction)])
            ),
            self.effect("heat", self.one(self.warmth * self.x, 0)[None]),
            self.effect("heat-twin", self.one(self.time * self.x, 0)[None]),
            self.effect("drift", self.two(self.time)),
            self.cyclic(),
        ]
        responses = (Response("axes", self.two(np.ones(POSES)), size=2.0),)
        variables = [("x", self.x), ("y", self.y), ("time_s", self.time), ("warmth", self.warmth)]
        self.structure = structure_candidates(
            [Variable(name, np.tile(values, 2), responses) for name, values in variables]
            + [Variable("time_s", np.tile(self.time, 2), responses, ("periodic",), 0.08)]
        )
        before = np.concatenate([np.arange(POSES - 1), POSES + np.arange(POSES - 1)])
        self.quadratic = [Neighbours(before, before + 1)]

    def one(self, shape, component):
        row = np.zeros((2, POSES))
        row[component] = shape
        return row.reshape(-1)

    def two(self, shape):
        return np.array([self.one(shape, 0), self.one(shape, 1)])

    def effect(self, name, columns, trials=((),)):
        columns = columns if columns.ndim == 3 else columns[None]
        terms = tuple(Unknown(f"{name}.{k}", "mm", 2.0) for k in range(columns.shape[1]))
        alone = tuple((k,) for k in range(len(terms))) if name == "backlash" else ()
        return Candidate(name, terms, Columns.of(columns), trials, alone)

    def cyclic(self):
        periods = tuple((1.0 / f,) for f in np.linspace(1.0, 5.0, 17))
        waves = [
            (np.sin(2 * np.pi * self.x / p), np.cos(2 * np.pi * self.x / p)) for (p,) in periods
        ]
        columns = np.array([[self.one(sine, 0), self.one(cosine, 0)] for sine, cosine in waves])
        return self.effect("cyclic", columns, periods)

    def readings(self, hidden, rng, sigma=1.0):
        """Readings with ``hidden`` in them, geometry drawn from its prior."""
        sd = np.where(self.precision > 0, PRIOR, 3.0)
        ideal = self.geometry.T @ (sd * rng.normal(size=sd.size)) + hidden
        return ideal + sigma * rng.normal(size=ideal.size)

    def fit(self, data, kept=slice(None)):
        """Fit of geometry and frames to the components ``kept``."""
        jacobian = self.geometry[:, kept]
        normal = jacobian @ jacobian.T + np.diag(self.precision)
        values = np.linalg.solve(normal, jacobian @ data[kept])
        return LinearProblem(data[kept] - jacobian.T @ values, jacobian, self.precision)

    def fitted(self, hidden, rng, sigma=1.0):
        """Fit of readings with ``hidden`` in them."""
        return self.fit(self.readings(hidden, rng, sigma))

    def index(self, name):
        return [effect.name for effect in self.effects].index(name)
