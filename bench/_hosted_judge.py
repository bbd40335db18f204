"""What a verification shows, and what noise and parameter covariance say that it should show."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.command import Identified, standpoint
from calib.command.history import History
from calib.command.surroundings import Surroundings
from calib.command.uncertainty import pose_columns
from calib.frames import Frame, fit_frame
from calib.identify import Fit
from calib.mechanism.rigid import Poses, pose_difference
from calib.runs import Run

TRIALS = 2000
LIMIT = 1.15
"""How far the RMS may be above what is expected."""


@dataclass(frozen=True, eq=False)
class Judged:
    """Position errors (N,) in um at poses, as the tracker saw them and as they truly are.

    ``expected_rms`` and ``peak_99``: RMS and 99 % quantile of the peak over the same poses, from
    the readings' covariances and that of what was identified; ``likely`` the part of such
    verifications whose RMS is at most ``LIMIT`` times that: errors of one machine and of one base
    frame are common to all poses and do not average out. ``fit_rms`` is the RMS of the truth by
    the covariance of the fit alone.
    """

    seen_um: Array
    expected_rms: float
    peak_99: float
    likely: float
    fit_rms: float

    @property
    def rms(self) -> float:
        """RMS over the poses."""
        return float(np.sqrt(np.mean(self.seen_um**2)))

    @property
    def ratio(self) -> float:
        """RMS by what is expected."""
        return self.rms / self.expected_rms

    @property
    def peak(self) -> float:
        """Largest error."""
        return float(self.seen_um.max())


def judge(run: Run, wanted: Poses, identified: Identified, fit: Fit, q: Array, here: Surroundings,
          generator: np.random.Generator) -> Judged:  # fmt: skip
    """Fit every pose of a run to its nests, in the frame of its base nests.

    Parameters
    ----------
    run : Run
        Its poses are labelled 1..N in the order of ``wanted``.
    q : (n, N)
        As they were commanded, one after the other, from home.
    here : Surroundings
        Of the commands.
    """
    base_rows = [k for k, nest in enumerate(run.nest) if nest in run.header.base_nests]
    base_local = np.array([run.header.base_nests[run.nest[k]] for k in base_rows]).T
    base = fit_frame(base_local, run.position[:, base_rows])[0]
    trials = TRIALS
    frame_error = _fit_errors(base, base_local, run.covariance[:, :, base_rows], generator, trials)
    moved = moved_by_parameters(identified, fit, q, here, generator, trials)
    seen, squares, peaks = [], np.zeros(trials), np.zeros(trials)
    for k in range(wanted.count):
        rows = [
            r for r, (pose, nest) in enumerate(zip(run.pose, run.nest, strict=True))
            if pose == str(k + 1) and nest in run.header.platform_nests
        ]  # fmt: skip
        local = np.array([run.header.platform_nests[run.nest[r]] for r in rows]).T
        points = base.inverse().apply(run.position[:, rows])
        found = fit_frame(local, points)[0]
        twist = pose_difference(
            wanted.take(np.array([k])),
            Poses(found.translation[:, None], found.rotation[:, :, None]),
        )
        seen.append(1e3 * float(np.linalg.norm(twist[:3])))
        covariance = run.covariance[:, :, rows]
        error = _fit_errors(base.after(found), local, covariance, generator, trials)
        at = base.rotation @ found.translation
        shift = frame_error[:3] + np.cross(frame_error[3:].T, at).T
        total = error[:3] - shift + base.rotation @ moved[:, k]
        norm = 1e3 * np.linalg.norm(total, axis=0)
        squares += norm**2
        peaks = np.maximum(peaks, norm)
    expected = float(np.sqrt(np.mean(squares) / wanted.count))
    likely = float(np.mean(np.sqrt(squares / wanted.count) <= LIMIT * expected))
    fit_rms = 1e3 * float(np.sqrt(np.mean(np.sum(moved**2, axis=0))))
    return Judged(np.array(seen), expected, float(np.quantile(peaks, 0.99)), likely, fit_rms)


def moved_by_parameters(
    identified: Identified,
    fit: Fit,
    q: Array,
    here: Surroundings,
    generator: np.random.Generator,
    trials: int,
) -> Array:
    """Shifts (3, N, trials) of the platform in mm by errors drawn from the fit's covariance."""
    machine = identified.machine
    at = standpoint(identified, machine.extension(q), here, History.at_home(machine))
    place = {name: k for k, name in enumerate(identified.names)}
    kept = [k for k, name in enumerate(fit.model.names) if name in place]
    stacked = pose_columns(at)[[place[fit.model.names[k]] for k in kept], :3]
    covariance = fit.covariance[np.ix_(kept, kept)]
    drawn = generator.multivariate_normal(
        np.zeros(len(kept)), covariance, trials, method="eigh", check_valid="ignore"
    )
    return np.asarray(np.einsum("pcn,tp->cnt", stacked, drawn))


def _fit_errors(
    frame: Frame, local: Array, covariance: Array, generator: np.random.Generator, trials: int
) -> Array:
    """Errors (6, trials) of a rigid fit to noisy points: mm and rad, tracker axes."""
    blocks, noise = [], []
    for point, own in zip(local.T, np.moveaxis(covariance, -1, 0), strict=True):
        x, y, z = frame.rotation @ point
        turn = np.array([[0.0, z, -y], [-z, 0.0, x], [y, -x, 0.0]])
        blocks.append(np.hstack([np.eye(3), turn]))
        noise.append(np.linalg.cholesky(own) @ generator.standard_normal((3, trials)))
    return np.asarray(np.linalg.pinv(np.vstack(blocks)) @ np.vstack(noise))
