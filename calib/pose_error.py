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
