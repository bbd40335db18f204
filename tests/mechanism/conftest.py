"""Machines and poses for the laws of the mechanism engine."""

from importlib.resources import files

import numpy as np
import pytest

from calib.mechanism.description import Machine
from calib.mechanism.parse import parse_machine
from calib.mechanism.solve import Configuration, inverse


def load(name: str) -> Machine:
    return parse_machine(files("calib.machines").joinpath(f"{name}.toml").read_text(), name)


def reachable(machine: Machine, count: int, seed: int) -> Configuration:
    """Random task coordinates of the workspace that the strokes allow."""
    rng = np.random.default_rng(seed)
    low, high = np.array([machine.workspace[c] for c in machine.task.coordinates]).T
    values = low[:, None] + (high - low)[:, None] * rng.random((len(low), 6 * count))
    found = inverse(machine, values)
    good = found.converged & machine.within_stroke(machine.coordinates(found.extension))
    assert np.count_nonzero(good) >= count
    return found.take(np.flatnonzero(good)[:count])


def manufactured(machine: Machine, seed: int, share: float = 1.0) -> np.ndarray:
    """Parameters with errors uniform within the tolerances."""
    rng = np.random.default_rng(seed)
    return machine.nominal + share * machine.tolerance * rng.uniform(-1, 1, len(machine.nominal))


@pytest.fixture(scope="session")
def hexapod() -> Machine:
    return load("hexapod")
