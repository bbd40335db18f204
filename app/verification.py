"""How far the platform is from where it was sent, over a grid of poses (Han et al. 2020, Table 6).

The operator's view: each pose is fitted to its nests as the tracker saw them, in the base frame
that the base nests give. What the tracker's own noise would show for a perfect machine stands
beside it. The judge's view exists on a mock only: the noise-free truth.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from app.session.journal import Journal, Row
from app.session.plan import Plan
from app.site import Site
from calib.arrays import Array
from calib.errors import BadInput
from calib.frames import Frame, fit_frame

FORMAT = "pkm-verification/1"
_TRIALS = 300
PAPER = {"position_peak_um": 12.0, "orientation_peak_deg": 0.0051}
"""Han et al. 2020, Table 6, measured after calibration."""


@dataclass(frozen=True)
class Summary:
    """Errors over all poses: position in um (norm of 3D), orientation in deg (rotation angle)."""

    position_peak_um: float
    position_std_um: float
    position_rms_um: float
    orientation_peak_deg: float
    orientation_std_deg: float
    orientation_rms_deg: float


@dataclass(frozen=True, eq=False)
class Verification:
    """Errors pose by pose, as measured and, on a mock, as they truly are.

    ``position_mm`` (3, N) and ``rotation_rad`` (3, N) in base axes; ``noise_peak_*`` are the mean
    peaks over the same poses that the tracker's noise alone would show.
    """

    labels: tuple[str, ...]
    position_mm: Array
    rotation_rad: Array
    noise_peak_um: float
    noise_peak_deg: float
    truth_position_mm: Array | None
    truth_rotation_rad: Array | None

    @property
    def measured(self) -> Summary:
        """As the tracker sees it."""
        return summary(self.position_mm, self.rotation_rad)

    @property
    def truth(self) -> Summary | None:
        """As it is; None on hardware."""
        if self.truth_position_mm is None or self.truth_rotation_rad is None:
            return None
        return summary(self.truth_position_mm, self.truth_rotation_rad)

    def to_json(self) -> dict[str, Any]:
        """Answer of ``pkmcal verify --json``."""
        truth = self.truth
        return {
            "format": FORMAT,
            "poses": len(self.labels),
            "measured": vars(self.measured),
            "noise_alone": {
                "position_peak_um": self.noise_peak_um,
                "orientation_peak_deg": self.noise_peak_deg,
            },
            "truth": vars(truth) if truth else None,
            "paper": PAPER,
            "errors": [
                {
                    "pose": label,
                    "position_um": [1e3 * float(v) for v in self.position_mm[:, k]],
                    "rotation_deg": [float(np.rad2deg(v)) for v in self.rotation_rad[:, k]],
                }
                for k, label in enumerate(self.labels)
            ],
        }


def summary(position_mm: Array, rotation_rad: Array) -> Summary:
    """Peak, standard deviation and RMS of the norms."""
    p = 1e3 * np.linalg.norm(position_mm, axis=0)
    r = np.rad2deg(np.linalg.norm(rotation_rad, axis=0))
    return Summary(
        float(p.max()), float(p.std()), float(np.sqrt(np.mean(p * p))),
        float(r.max()), float(r.std()), float(np.sqrt(np.mean(r * r))),
    )  # fmt: skip


def judge(site: Site, plan: Plan, journal: Journal) -> Verification:
    """Judge the poses of a finished session; raises BadInput where too little was read.

    A pose counts when at least three of its nests were read.
    """
    rows = [row for row in journal.rows() if row.kind == "reading"]
    frame, frame_rows = _base_frame(site, rows)
    back = frame.inverse()
    seen: dict[str, dict[str, Row]] = {label: {} for label in plan.poses}
    for row in rows:
        if row.pose in seen and row.nest in site.platform_nests:
            seen[row.pose][row.nest] = row
    labels = tuple(label for label, nests in seen.items() if len(nests) >= 3)
    if not labels:
        raise BadInput(
            "no pose was read with three nests",
            remedy="Verify with SMRs in at least three platform nests",
        )
    position, rotation = np.empty((3, len(labels))), np.empty((3, len(labels)))
    for k, label in enumerate(labels):
        found = _pose_seen(site, back, seen[label])
        position[:, k], rotation[:, k] = _difference(Frame.of(plan.poses[label]), found)
    peak_um, peak_deg = _noise_peaks(site, frame, frame_rows, [seen[p] for p in labels], plan)
    truth = _truth(plan, journal, labels)
    return Verification(labels, position, rotation, peak_um, peak_deg, *truth)


def _base_frame(site: Site, rows: list[Row]) -> tuple[Frame, list[Row]]:
    """Fit the base to all its readings together."""
    base = [row for row in rows if row.nest in site.base_nests]
    if len({row.nest for row in base}) < 3:
        raise BadInput("fewer than three base nests were read", remedy="Do not skip them")
    drawn = np.array([site.base_nests[row.nest] for row in base]).T
    return fit_frame(drawn, np.array([row.xyz for row in base]).T)[0], base


def _pose_seen(site: Site, back: Frame, nests: Mapping[str, Row]) -> Frame:
    """Pose of the platform in the base frame from its nests."""
    drawn = np.array([site.platform_nests[nest] for nest in nests]).T
    seen = back.apply(np.array([row.xyz for row in nests.values()]).T)
    return fit_frame(drawn, seen)[0]


def _difference(wanted: Frame, found: Frame) -> tuple[Array, Array]:
    """Position (3,) mm and rotation vector (3,) rad from wanted to found."""
    turn = found.rotation @ wanted.rotation.T
    sine = 0.5 * np.array(
        [turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]]
    )
    size = float(np.linalg.norm(sine))
    angle = float(np.arctan2(size, 0.5 * (np.trace(turn) - 1.0)))
    vector = sine * (angle / size) if size > 0.0 else sine
    return found.translation - wanted.translation, vector


def _truth(
    plan: Plan, journal: Journal, labels: tuple[str, ...]
) -> tuple[Array | None, Array | None]:
    """True errors of the same poses, where the plan asked a mock for them."""
    states = journal.states()
    true: dict[str, Frame] = {}
    for step in plan.steps:
        if step.kind == "truth" and step.id in states and states[step.id].state == "done":
            result = states[step.id].result
            true[result["pose"]] = Frame(np.array(result["rotation"]), np.array(result["position"]))
    if not all(label in true for label in labels):
        return None, None
    pairs = [_difference(Frame.of(plan.poses[label]), true[label]) for label in labels]
    return np.array([p for p, _ in pairs]).T, np.array([r for _, r in pairs]).T


def _noise_peaks(
    site: Site, frame: Frame, base: list[Row], poses: list[dict[str, Row]], plan: Plan
) -> tuple[float, float]:
    """Mean peaks (um, deg) over the poses that the readings' own uncertainty would show.

    Small errors of nests and base nests are drawn from their covariances and mapped through the
    linearised rigid fits; the base frame's error is common to all poses of a trial.
    """
    generator = np.random.default_rng(216)
    drawn = [np.array(site.base_nests[row.nest]) for row in base]
    frame_error = _fit_errors(frame, drawn, base, generator)
    peaks = np.zeros((2, _TRIALS))
    for nests in poses:
        local = [np.array(site.platform_nests[nest]) for nest in nests]
        pose = Frame.of(plan.poses[next(iter(nests.values())).pose])
        error = _fit_errors(frame.after(pose), local, list(nests.values()), generator)
        # The frame's error as it shows at the platform, in tracker axes.
        at = frame.rotation @ pose.translation
        shift = frame_error[:3] + np.cross(frame_error[3:].T, at).T
        position = np.linalg.norm(error[:3] - shift, axis=0)
        angle = np.linalg.norm(error[3:] - frame_error[3:], axis=0)
        peaks = np.maximum(peaks, np.stack([position, angle]))
    return 1e3 * float(peaks[0].mean()), float(np.rad2deg(peaks[1].mean()))


def _fit_errors(
    frame: Frame, points: list[Array], rows: list[Row], generator: np.random.Generator
) -> Array:
    """Errors (6, trials) of a rigid fit: shift of its origin (mm), rotation vector (rad)."""
    blocks, noise = [], []
    for point, row in zip(points, rows, strict=True):
        x, y, z = frame.rotation @ point
        turn = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
        blocks.append(np.hstack([np.eye(3), turn]))
        assert row.covariance is not None
        xx, yy, zz, xy, xz, yz = row.covariance
        root = np.linalg.cholesky(np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]))
        noise.append(root @ generator.standard_normal((3, _TRIALS)))
    errors: Array = np.linalg.pinv(np.vstack(blocks)) @ np.vstack(noise)
    return errors
