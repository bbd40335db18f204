"""Measuring campaigns without wires: the same physics, vectorised over a whole run.

``simulate(plan)`` gives a run as texts (``run.toml``, ``points.csv``) and the truth apart.
"""

from mocks.simulate.plan import Profile, RunPlan
from mocks.simulate.run import SimulatedRun, simulate

__all__ = ["Profile", "RunPlan", "SimulatedRun", "simulate"]
