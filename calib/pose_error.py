"""How far a platform is from where it was sent, and what a tracker's noise alone would show.

Pose errors are position (3, N) in mm and rotation vector (3, N) in rad, base axes, wanted -> found.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.frames import Frame
from calib.mechanism.rigid import Poses, pose_difference

TRIALS = 300


@dataclass(frozen=True)
class Summary:
    """Errors over all poses: position in um (norm of 3D), orientation in deg (rotation angle)."""

    position_peak_um: float
    position_std_um: float
    position_rms_um: float
    orientation_peak_deg: float
    orientation_std_deg: float
    orientation_rms_deg: float


def summary(position_mm: Array, rotation_rad: Array) -> Summary:
    """Peak, standard deviation and RMS of the norms (Han et al. 2020, Table 6)."""
    p = 1e3 * np.linalg.norm(position_mm, axis=0)
    r = np.rad2deg(np.linalg.norm(rotation_rad, axis=0))
    return Summary(
        float(p.max()), float(p.std()), float(np.sqrt(np.mean(p * p))),
        float(r.max()), float(r.std()), float(np.sqrt(np.mean(r * r))),
    )  # fmt: skip


def pose_errors(wanted: Sequence[Frame], found: Sequence[Frame]) -> tuple[Array, Array]:
    """Position (3, N) and rotation vector (3, N) from each wanted pose to the one found."""
    twist = pose_difference(_poses(wanted), _poses(found))
    return twist[:3], twist[3:]


def _poses(frames: Sequence[Frame]) -> Poses:
    return Poses(
        np.stack([f.translation for f in frames], axis=1),
        np.stack([f.rotation for f in frames], axis=2),
    )


@dataclass(frozen=True, eq=False)
class SeenPoints:
    """Points (3, K) of a frame as a tracker read them, with covariances (K, 3, 3) in mm^2."""

    local: Array
    covariance: Array


def noise_peaks(
    base: Frame,
    base_seen: SeenPoints,
    poses: Sequence[tuple[Frame, SeenPoints]],
    generator: np.random.Generator,
) -> tuple[float, float]:
    """Mean peaks (mm, rad) over the poses that the readings' own uncertainty would show.

    Errors of nests and base nests are drawn from their covariances and mapped through the
    linearised rigid fits; the base frame's error is common to all poses of a trial.

    Parameters
    ----------
    base : Frame
        Base frame in the tracker frame.
    base_seen : SeenPoints
        Base nests, base frame.
    poses : sequence of (Frame, SeenPoints)
        Platform in the base frame, and its nests in the platform frame.
    generator : numpy Generator
    """
    frame_error = _fit_errors(base, base_seen, generator)
    peaks = np.zeros((2, TRIALS))
    for pose, seen in poses:
        error = _fit_errors(base.after(pose), seen, generator)
        # The frame's error as it shows at the platform, in tracker axes.
        at = base.rotation @ pose.translation
        shift = frame_error[:3] + np.cross(frame_error[3:].T, at).T
        position = np.linalg.norm(error[:3] - shift, axis=0)
        angle = np.linalg.norm(error[3:] - frame_error[3:], axis=0)
        peaks = np.maximum(peaks, np.stack([position, angle]))
    return float(peaks[0].mean()), float(peaks[1].mean())


def _fit_errors(frame: Frame, seen: SeenPoints, generator: np.random.Generator) -> Array:
    """Errors (6, trials) of a rigid fit: shift of its origin (mm), rotation vector (rad)."""
    blocks, noise = [], []
    for point, covariance in zip(seen.local.T, seen.covariance, strict=True):
        x, y, z = frame.rotation @ point
        turn = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
        blocks.append(np.hstack([np.eye(3), turn]))
        root = np.linalg.cholesky(covariance)
        noise.append(root @ generator.standard_normal((3, TRIALS)))
    errors: Array = np.linalg.pinv(np.vstack(blocks)) @ np.vstack(noise)
    return errors


@dataclass(frozen=True, eq=False)
class ErrorCovariance:
    """What the readings' own uncertainty leaves open of the errors (6, N) of all poses.

    Attributes
    ----------
    own : (N, 6, 6)
        Of each pose's rigid fit: shift in mm, rotation vector in rad, base axes.
    lever : (N, 6, 6)
        How an error of the base frame shows in each pose's error.
    common : (6, 6)
        Of the base frame, which all poses share.
    """

    own: Array
    lever: Array
    common: Array

    @property
    def each(self) -> Array:
        """Covariance of every pose's error, (N, 6, 6)."""
        shared: Array = self.lever @ self.common @ np.swapaxes(self.lever, 1, 2)
        return self.own + shared

    def of(self, weights: Array) -> float:
        """Standard uncertainty of the sum of all errors times ``weights`` (N, 6)."""
        alone = np.einsum("ni,nij,nj->", weights, self.own, weights)
        shared = np.einsum("nij,ni->j", self.lever, weights)
        return float(np.sqrt(alone + shared @ self.common @ shared))

    def widest(self, part: slice) -> Array:
        """Standard uncertainty (N,) in the direction that is known worst; ``part``: which three."""
        found: Array = np.sqrt(np.linalg.eigvalsh(self.each[:, part, part])[:, -1])
        return found


def error_covariance(
    base: Frame, base_seen: SeenPoints, poses: Sequence[tuple[Frame, SeenPoints]]
) -> ErrorCovariance:
    """Covariance of pose errors by linearised rigid fits; arguments as of :func:`noise_peaks`."""
    back = base.rotation.T
    lever = np.tile(-np.eye(6), (len(poses), 1, 1))
    for matrix, (pose, _) in zip(lever, poses, strict=True):
        matrix[:3, 3:] = _turning(pose.translation)
    return ErrorCovariance(
        np.array([_fit_covariance(base.after(pose), seen, back) for pose, seen in poses]),
        lever,
        _fit_covariance(base, base_seen, back),
    )


def _fit_covariance(frame: Frame, seen: SeenPoints, back: Array) -> Array:
    """Covariance (6, 6) of a rigid fit's shift and turn, in the axes to which ``back`` turns."""
    rows, spread = [], np.zeros((3 * len(seen.covariance),) * 2)
    for k, (point, covariance) in enumerate(zip(seen.local.T, seen.covariance, strict=True)):
        rows.append(np.hstack([np.eye(3), -_turning(frame.rotation @ point)]))
        spread[3 * k : 3 * k + 3, 3 * k : 3 * k + 3] = covariance
    solve = np.kron(np.eye(2), back) @ np.linalg.pinv(np.vstack(rows))
    found: Array = solve @ spread @ solve.T
    return found


def _turning(vector: Array) -> Array:
    """Matrix (3, 3) of the cross product with a vector (3,) from the left."""
    x, y, z = vector
    return np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
