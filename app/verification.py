"""How far the platform is from where it was sent, over a grid of poses (Han et al. 2020, Table 6).

A machine that commands fewer than six coordinates was sent where its controller's parameters put
the rest: its errors are what those parameters do not know.

The operator's view: each pose is fitted to its nests as the tracker saw them, in the base frame
that the base nests give. What the tracker's own noise would show for a perfect machine stands
beside it. The judge's view exists on a mock only: the noise-free truth.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from app.defaults import REFERENCE_EVERY
from app.files.pose_table import Pose
from app.files.site import Site, load_site
from app.files.text import read_text
from app.session.journal import PARAMETERS, Journal
from app.session.kinds import TRUTH
from app.session.plan import Plan
from app.session.plans import PlanOptions, measure_plan, order_for
from app.session.rows import PLANNED, Row
from calib.arrays import Array
from calib.errors import BadInput
from calib.frames import Frame, fit_frame
from calib.mechanism.rigid import Poses
from calib.mechanism.solve import inverse
from calib.mechanism.task import FULL
from calib.pose_error import (
    ErrorCovariance,
    SeenPoints,
    Summary,
    error_covariance,
    noise_peaks,
    pose_errors,
    summary,
)

FORMAT = "pkm-verification/1"
COVERAGE = 2.0
"""Coverage factor of expanded uncertainties: about 95 %."""
AXES = ("x", "y", "z", "rx", "ry", "rz")
MOVED, TURNED = slice(0, 3), slice(3, 6)
PAPER = {"position_peak_um": 12.0, "orientation_peak_deg": 0.0051}
"""Han et al. 2020, Table 6, measured after calibration."""


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
    spread: ErrorCovariance | None = None
    """What the readings' own uncertainty leaves open of the errors; None where nobody asked."""

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
            "expanded": self._expanded(),
            "axes": self._axes(),
            "errors": [self._error(k) for k in range(len(self.labels))],
        }

    def _error(self, k: int) -> dict[str, Any]:
        """One pose: errors in base axes, and expanded uncertainties in the worst direction."""
        return {
            "pose": self.labels[k],
            "position_um": [1e3 * float(v) for v in self.position_mm[:, k]],
            "rotation_deg": [float(np.rad2deg(v)) for v in self.rotation_rad[:, k]],
            "position_u_um": None if self._widest is None else 1e3 * float(self._widest[0][k]),
            "rotation_u_deg": (
                None if self._widest is None else float(np.rad2deg(self._widest[1][k]))
            ),
        }

    @cached_property
    def _widest(self) -> tuple[Array, Array] | None:
        """Expanded uncertainty of every pose in its worst direction: mm, rad."""
        if self.spread is None:
            return None
        return COVERAGE * self.spread.widest(MOVED), COVERAGE * self.spread.widest(TURNED)

    def _expanded(self) -> dict[str, float] | None:
        """Expanded uncertainties of peak and RMS, from what the tracker states of each reading."""
        if self.spread is None or self._widest is None:
            return None
        found: dict[str, float] = {"k": COVERAGE}
        parts = (
            ("position", "um", 1e3, self.position_mm, MOVED),
            ("orientation", "deg", float(np.rad2deg(1.0)), self.rotation_rad, TURNED),
        )
        for (name, unit, scale, error, part), widest in zip(parts, self._widest, strict=True):
            norm = np.linalg.norm(error, axis=0)
            rms = float(np.sqrt(np.mean(norm**2)))
            weights = np.zeros((norm.size, 6))
            weights[:, part] = error.T / max(norm.size * rms, np.finfo(float).tiny)
            found[f"{name}_peak_{unit}"] = scale * float(widest[np.argmax(norm)])
            found[f"{name}_rms_{unit}"] = scale * COVERAGE * self.spread.of(weights)
        return found

    def _axes(self) -> list[dict[str, Any]]:
        """Mean, standard deviation and largest error along each base axis."""
        errors = np.vstack([1e3 * self.position_mm, np.rad2deg(self.rotation_rad)])
        scale = np.repeat([1e3, np.rad2deg(1.0)], 3)
        count = len(self.labels)
        found: list[dict[str, Any]] = []
        for row, (axis, error) in enumerate(zip(AXES, errors, strict=True)):
            weights = np.zeros((count, 6))
            weights[:, row] = 1.0 / count
            u_mean = None
            if self.spread is not None:
                u_mean = COVERAGE * float(scale[row]) * self.spread.of(weights)
            found.append(
                {
                    "axis": axis,
                    "unit": "um" if row < 3 else "deg",
                    "mean": float(error.mean()),
                    "std": float(error.std()),
                    "largest": float(error[np.argmax(np.abs(error))]),
                    "u_mean": u_mean,
                }
            )
        return found


def verification_plan(
    site: Site, poses: Mapping[str, Pose], *, truth: bool, reference_every: int = REFERENCE_EVERY
) -> Plan:
    """Visit poses to see how far off the machine is; ``truth`` also asks a mock."""
    options = PlanOptions(
        order=order_for(site),
        reference_every=reference_every,
        warm_up=False,
        two_face=False,
        truth=truth,
        title=f"verification, {len(poses)} poses",
    )
    return measure_plan(site, poses, options, "verify")


def judge_session(folder: Path) -> Verification:
    """Judge a finished session from its folder; raises as :func:`judge` does."""
    plan = Plan.from_json(read_text(folder / "plan.json"), str(folder / "plan.json"))
    journal = Journal(folder / "journal.sqlite", read_only=True)
    try:
        return judge(load_site(folder / "site.toml"), plan, journal)
    finally:
        journal.close()


def judge(site: Site, plan: Plan, journal: Journal) -> Verification:
    """Judge the poses of a finished session; raises BadInput where too little was read.

    A pose counts when at least three of its nests were read.
    """
    rows = [row for row in journal.rows() if row.kind == "reading"]
    frame, base = _base_frame(site, rows)
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
    wanted = _wanted(site, plan, journal, labels)
    points = [_seen(list(seen[label].values()), site.platform_nests) for label in labels]
    back = frame.inverse()
    found = [
        fit_frame(nests.local, back.apply(_read(list(seen[label].values()))))[0]
        for label, nests in zip(labels, points, strict=True)
    ]
    position, rotation = pose_errors(wanted, found)
    poses = list(zip(wanted, points, strict=True))
    peak_mm, peak_rad = noise_peaks(frame, base, poses, np.random.default_rng(len(labels)))
    truth = _truth(plan, journal, labels, wanted)
    spread = error_covariance(frame, base, poses)
    return Verification(
        labels, position, rotation, 1e3 * peak_mm, float(np.rad2deg(peak_rad)), *truth, spread
    )


def _wanted(site: Site, plan: Plan, journal: Journal, labels: tuple[str, ...]) -> list[Frame]:
    """Where the platform was sent."""
    machine = site.machine
    if machine.task.coordinates == FULL:
        return [Frame.of(plan.poses[label]) for label in labels]
    held: dict[str, float] = journal.meta(PARAMETERS, {})
    known = {name: v for name, v in held.items() if name in machine.parameter_index}
    target = Poses.from_xyz_rpy(np.array([plan.poses[label] for label in labels]).T)
    poses = inverse(machine, target, machine.vector(known)).poses
    return [Frame(poses.rotation[:, :, k], poses.position[:, k]) for k in range(len(labels))]


def _base_frame(site: Site, rows: list[Row]) -> tuple[Frame, SeenPoints]:
    """Fit the base to all its readings together."""
    base = [row for row in rows if row.nest in site.base_nests]
    if len({row.nest for row in base}) < 3:
        raise BadInput("fewer than three base nests were read", remedy="Do not skip them")
    seen = _seen(base, site.base_nests)
    return fit_frame(seen.local, _read(base))[0], seen


def _read(rows: list[Row]) -> Array:
    """What the tracker read, (3, K)."""
    return np.array([row.xyz for row in rows]).T


def _seen(rows: list[Row], nests: Mapping[str, Any]) -> SeenPoints:
    """Where the nests of the rows are by their drawing, and how sure the readings are."""
    covariances = []
    for row in rows:
        assert row.covariance is not None
        xx, yy, zz, xy, xz, yz = row.covariance
        covariances.append([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return SeenPoints(np.array([nests[row.nest] for row in rows]).T, np.array(covariances))


def _truth(
    plan: Plan, journal: Journal, labels: tuple[str, ...], wanted: list[Frame]
) -> tuple[Array | None, Array | None]:
    """True errors of the same poses, where the plan asked a mock for them."""
    states = journal.states()
    true: dict[str, Frame] = {}
    for step in plan.steps:
        state = states.get(step.id, PLANNED)
        if step.kind is TRUTH and state.state == "done":
            result = state.result
            true[result["pose"]] = Frame(np.array(result["rotation"]), np.array(result["position"]))
    if not all(label in true for label in labels):
        return None, None
    return pose_errors(wanted, [true[label] for label in labels])
