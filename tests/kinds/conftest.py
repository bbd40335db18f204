"""Laboratories with every kind of reading, on any machine that ships."""

import numpy as np
import pytest

from calib.mechanism.description import Machine
from calib.mechanism.rigid import exponential
from calib.mechanism.solve import forward
from calib.runs import parse_run
from calib.runs.stack import Rows, stack
from mocks.simulate.kinds import Laboratory, Stand
from tests.mechanism.conftest import load, reachable

UP = np.array([0.0, 0.0, 1.0])
SLANTED = np.array([0.36, 0.48, 0.8])


def everything(
    machine: Machine, seed: int, noise: float = 1.0, poses: int = 6, share: float = 1.0
) -> Laboratory:
    """Every kind of reading at some poses; nests, a plane and zeros are not exactly known.

    ``noise`` 0 reads exactly, with the same stated sigmas; ``share`` of the tolerances is drawn.
    """
    rng = np.random.default_rng(seed)
    size = machine.size
    stated = {
        "p1": np.array([0.4, 0.0, 0.1]) * size,
        "p2": np.array([-0.3, 0.3, 0.0]) * size,
        "p3": np.array([-0.2, -0.35, 0.05]) * size,
        "b1": np.array([1.0, 0.2, -0.3]) * size,
        "b2": np.array([-0.8, 0.9, -0.3]) * size,
        "b3": np.array([-0.5, -1.1, -0.3]) * size,
        "anchor": np.array([0.3, 0.4, -1.4]) * size,
    }
    root = np.array([[0.3, 0.0, 0.0], [0.1, 0.2, 0.0], [0.0, 0.05, 0.25]])
    true = dict(stated)
    true["p3"] = stated["p3"] + 0.2 * rng.standard_normal(3)
    true["anchor"] = stated["anchor"] + root @ rng.standard_normal(3)
    spread = (root @ root.T)[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    listed = {name: place.tolist() for name, place in stated.items()}
    header = {
        "machine": machine.name,
        "nests": {
            "platform": {
                "p1": listed["p1"],
                "p2": listed["p2"],
                "p3": {"at": listed["p3"], "sigma": 0.2},
            },
            "base": {
                **{name: listed[name] for name in ("b1", "b2", "b3")},
                "anchor": {"at": listed["anchor"], "covariance": spread.tolist()},
            },
        },
        "instruments": {
            "tracker": {},
            "theodolite": {"near": [0.1 * size, 0.2 * size, -2.0 * size, 0.0, 0.0, 0.5]},
            "camera": {},
            "gauge": {"frame": "base", "zero_sigma": 1.0, "scale_sigma": 1e-3},
            "probe": {"frame": "base"},
            "bar": {},
            "calipers": {"scale_sigma": 1e-3},
            "level": {"frame": "base", "zero_sigma": 1e-3},
        },
        "planes": {
            "bed": {
                "normal": UP.tolist(),
                "through": [0.0, 0.0, -3.0 * size],
                "sigma": 0.5,
                "tilt_sigma": 1e-3,
            }
        },
    }

    def stand(yaw: float, *place: float) -> Stand:
        return Stand(exponential(np.array([0.02, -0.03, yaw])), np.array(place) * size)

    lab = Laboratory(
        header=header,
        platform={name: true[name] for name in ("p1", "p2", "p3")},
        base={name: true[name] for name in ("b1", "b2", "b3", "anchor")},
        actuators=len(machine.actuators),
        rng=rng if noise else Still(),
        stands={
            "tracker": stand(1.2, 3.0, 1.0, -1.0),
            "theodolite": stand(0.5, 0.1, 0.2, -2.0),
            "camera": stand(-0.8, 0.5, -2.0, 1.0),
        },
    )
    ways = reachable(machine, poses, seed=seed)
    off = share * machine.prior_sigma * rng.standard_normal(machine.prior_sigma.size)
    parameters = machine.nominal + off
    real = forward(machine, ways.extension, parameters)
    assert real.converged.all()
    q = machine.coordinates(ways.extension)
    lab.q, lab.parameters = q, parameters
    normal = np.array([4e-4, -6e-4, 1.0])
    normal /= np.linalg.norm(normal)
    for k in range(poses):
        lab.go(f"{k}", q[:, k].tolist(), real.poses.position[:, k], real.poses.rotation[:, :, k])
        lab.move()
        for nest in ("p1", "p2", "p3", "b1", "b2", "b3"):
            lab.point(nest, 0.01, by="tracker")
            lab.angles(nest, 1e-5, by="theodolite", only=("both", "azimuth", "elevation")[k % 3])
        lab.point("p1", 0.01, by="tracker", only="z")
        lab.point("p2", 0.01, by="tracker", only="xy", vague=1000.0)
        lab.distance("p3", "", 0.02, by="tracker")
        lab.pose("p1", 0.02, 2e-5, by="camera")
        lab.direction("p2", SLANTED, 0.003, by="gauge", zero=0.7, long=4e-4)
        lab.touch("p3", "bed", normal, np.array([0.0, 0.0, -3.0 * size]), 0.004, by="probe")
        lab.distance("p1", "anchor", 0.01, by="bar")
        lab.distance("b1", "p2", 0.01, by="bar")
        lab.tilt("p1", np.array([1.0, 0.0, 0.0]), 2e-5, by="level", zero=4e-4)
    lab.marks("p1", "0", "2", 0.01, by="bar")
    lab.marks("p3", "1", "2", 0.01, by="calipers", long=-5e-4)
    lab.distance("p1", "p3", 0.002, by="bar")
    lab.distance("b2", "anchor", 0.01, by="bar")
    return lab


class Still:
    """A generator whose draws are zero: readings without noise."""

    def standard_normal(self, size=None):
        return 0.0 if size is None else np.zeros(size)


def rows_of(machine: Machine, lab: Laboratory) -> Rows:
    return stack(machine, [parse_run(*lab.texts(), actuators=len(machine.actuators))])


@pytest.fixture(scope="session")
def hexapod():
    return load("hexapod")
