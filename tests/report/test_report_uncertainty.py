"""Uncertainties of pose errors against what repeated measurements would show."""

import numpy as np
import pytest

from calib.frames import Frame, fit_frame
from calib.pose_error import SeenPoints, error_covariance, pose_errors

TRIALS = 300
BASE = np.array([[260.0, 0.0, -30.0], [0.0, 260.0, -30.0], [-260.0, 0.0, -30.0]]).T
NESTS = np.array([[0.0, 100.0, 0.0], [-86.6, -50.0, 0.0], [86.6, -50.0, 0.0]]).T
FRAME = Frame.of((-900.0, -700.0, -400.0, 0.02, -0.1, 0.6))
POSES = [
    Frame.of((5.0, -3.0, 220.0, 0.05, -0.04, 0.2)),
    Frame.of((-9.0, 8.0, 210.0, 0.0, 0.1, 0.0)),
]


def covariances(count: int, generator: np.random.Generator) -> np.ndarray:
    """Covariances of readings, larger across the beam than along it."""
    roots = 0.004 * generator.standard_normal((count, 3, 3))
    return roots @ np.swapaxes(roots, 1, 2) + np.diag([1e-6, 4e-6, 9e-6])


def test_errors_scatter_as_their_covariance_says() -> None:
    generator = np.random.default_rng(20261129)
    base_covariance = covariances(3, generator)
    nest_covariance = [covariances(3, generator) for _ in POSES]

    def read(true: np.ndarray, covariance: np.ndarray) -> np.ndarray:
        noise = [generator.multivariate_normal(np.zeros(3), one) for one in covariance]
        return true + np.array(noise).T

    found = np.empty((TRIALS, 2, 6))
    for trial in range(TRIALS):
        back = fit_frame(BASE, read(FRAME.apply(BASE), base_covariance))[0].inverse()
        seen = [
            fit_frame(NESTS, back.apply(read(FRAME.after(pose).apply(NESTS), covariance)))[0]
            for pose, covariance in zip(POSES, nest_covariance, strict=True)
        ]
        found[trial] = np.vstack(pose_errors(POSES, seen)).T
    said = error_covariance(
        FRAME,
        SeenPoints(BASE, base_covariance),
        [(pose, SeenPoints(NESTS, c)) for pose, c in zip(POSES, nest_covariance, strict=True)],
    )
    for pose in range(2):
        spread = found[:, pose].std(axis=0)
        assert spread == pytest.approx(np.sqrt(np.diag(said.each[pose])), rel=0.2)
    weights = generator.standard_normal((2, 6)) * [1, 1, 1, 100, 100, 100]
    summed = np.einsum("tpi,pi->t", found, weights)
    assert summed.std() == pytest.approx(said.of(weights), rel=0.2)
