"""Compare the model with a run: repeatability, structure against everything, where, which leg."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array, BoolArray
from calib.discover.problem import accepted, each_leg, every_leg, quadratics_of, variables_of
from calib.evidence.compare import JointTest, Speaking, compare_structure
from calib.evidence.repeats import PureError, pure_error
from calib.evidence.structure import Response, Variable
from calib.identify.fitting import Fit
from calib.mechanism.rigid import rotate

TOLD_APART = 100.0
"""Condition, actuators scaled alike, up to which the readings of a pose tell its actuators apart.

Three nests of a hexapod give some 20, of an arm 12 to 40; heights and marks by the hundred.
"""


@dataclass(frozen=True, eq=False)
class PoseResidual:
    """Residuals of M poses, their nests together, as the machine sees them.

    Attributes
    ----------
    names : tuple of M str
    position : (3, M)
        Platform origin, base frame, mm.
    shift : (3, M)
        Mean residual over the nests read at the pose, base frame, mm.
    extension : (n, M)
        Error of each actuator that explains the pose's residuals best, in its unit; nan where the
        readings of a pose cannot tell.
    q : (n, M)
        Commanded coordinates.
    """

    names: tuple[str, ...]
    position: Array
    shift: Array
    extension: Array
    q: Array


@dataclass(frozen=True, eq=False)
class RunComparison:
    """A model against a run; ``speaking`` has the state variable with the most structure first.

    ``displacement_mm`` is, for each of ``speaking``, the RMS over readings of what depends on it,
    the share of noise taken off.
    """

    fit: Fit
    repeatability: PureError
    reference_repeatability: PureError
    speaking: tuple[Speaking, ...]
    displacement_mm: tuple[float, ...]
    together: tuple[JointTest, ...]
    poses: PoseResidual


def compare_fit(fit: Fit, rng: np.random.Generator) -> RunComparison:
    """Compare a fitted model with its accepted readings."""
    problem = fit.problem
    speaking, together = compare_structure(
        problem,
        [*_of_machine(fit), *_of_reading(fit)],
        quadratics_of(fit),
        components=3,
        rng=rng,
        sharing=None if fit.whitening is None else (fit.freed, fit.as_stated),
    )
    platform = fit.model.rows.on_platform
    return RunComparison(
        fit=fit,
        repeatability=_repeats(fit, platform),
        reference_repeatability=_repeats(fit, ~platform),
        speaking=tuple(speaking),
        displacement_mm=tuple(_displacement(fit, one) for one in speaking),
        together=tuple(together),
        poses=pose_residuals(fit),
    )


def _of_machine(fit: Fit) -> list[Variable]:
    """State variables of the diagnosis, the pose's coordinates each by its own name."""
    names = iter(f"pose {name}" for name in ("x", "y", "z", "rx", "ry", "rz"))
    found = variables_of(fit)
    return [replace(one, name=next(names)) if one.name == "pose" else one for one in found]


def _of_reading(fit: Fit) -> list[Variable]:
    """Variables of the measurement: nest, range, angles of the tracker, size of the last step."""
    rows, situation, kept = fit.model.rows, fit.linear.situation, fit.accepted
    count = fit.readings
    x, y, z = situation.point[:, kept]
    points = Response("point", accepted(fit, rows.folded(np.swapaxes(situation.whitener, 0, 1))))
    turned = np.moveaxis(situation.frame_rotation, 1, 0)
    platform = [
        rotate(situation.rotation, axis[:, None] * np.ones(rows.count)) for axis in np.eye(3)
    ]
    in_tracker = [np.einsum("jin,jn->in", turned, one) for one in platform]
    seats = np.stack([np.einsum("ijn,jn->in", situation.whitener, one) for one in in_tracker])
    seats = rows.folded(seats * rows.on_platform)
    labels = {name: number for number, name in enumerate(dict.fromkeys(rows.nest_name))}
    nest = np.array([labels[name] for name in rows.nest_name], dtype=np.float64)[kept]
    found = [
        Variable("range", np.tile(np.sqrt(x**2 + y**2 + z**2), 3), (points,)),
        Variable("azimuth", np.tile(np.unwrap(np.arctan2(y, x)), 3), (points,)),
        Variable("elevation", np.tile(np.arctan2(z, np.hypot(x, y)), 3), (points,)),
        Variable("nest", np.tile(nest, 3), (Response("seat", accepted(fit, seats)),), ("levels",)),
    ]
    if np.any(rows.step):
        found += _steps(fit)
    return [one for one in found if one.values.shape[-1] == 3 * count]


def _steps(fit: Fit) -> list[Variable]:
    """Size of the last step: of all actuators together, or of each where their units differ."""
    rows = fit.model.rows
    steps = np.tile(rows.step[:, fit.accepted], (1, 3))
    if len(rows.machine.axes_by_unit) == 1:
        return [Variable("step", steps, (every_leg(fit),))]
    return [
        Variable(f"step{k + 1}", step, (leg,))
        for k, (step, leg) in enumerate(zip(steps, each_leg(fit), strict=True))
    ]


def _repeats(fit: Fit, which: BoolArray) -> PureError:
    """Repeats of the same pose, nest and direction of approach (reference nests: of the nest)."""
    rows = fit.model.rows
    states: list[object] = []
    for row in np.flatnonzero(fit.accepted):
        state = (int(rows.run[row]), rows.pose_name[row], rows.nest_name[row], rows.sort(int(row)))
        states.append((state, rows.direction[:, row].tobytes()) if which[row] else None)
    if not which[fit.accepted].any():
        return PureError(0, float("nan"), float("nan"), 0.0)
    if not fit.model.rows.on_platform[np.flatnonzero(which)[0]]:
        states = [state[0] if isinstance(state, tuple) else None for state in states]
    whitened = fit.linear.whitened[:, fit.accepted]
    return pure_error(whitened, states, fit.dof, rows.components[fit.accepted])


def _displacement(fit: Fit, speaking: Speaking) -> float:
    """RMS in mm over readings of what a variable explains, less noise's share (dof of chi2)."""
    moved = fit.model.rows.in_mm(speaking.fitted.reshape(3, -1), fit.accepted)
    share = max(1.0 - speaking.dof / max(speaking.chi2_fall, 1e-9), 0.0)
    return float(np.sqrt(share * np.mean(np.sum(moved**2, axis=0))))


def pose_residuals(fit: Fit) -> PoseResidual:
    """Residuals gathered by pose, in the base frame and in the actuators."""
    rows, situation = fit.model.rows, fit.linear.situation
    poses = _gathered(fit)
    columns = situation.actuator_columns
    n = columns.shape[0]
    base = np.einsum("jin,jn->in", situation.frame_rotation, _displaced(fit))
    extension = np.full((n, len(poses)), np.nan)
    shift = np.zeros((3, len(poses)))
    for number, members in enumerate(poses):
        shift[:, number] = base[:, members].mean(axis=1)
        own = columns[:, :, members].reshape(n, -1)
        normal = own @ own.T
        size = np.sqrt(np.diag(normal))
        if np.all(size > 0.0) and np.linalg.cond(normal / np.outer(size, size)) < TOLD_APART:
            whitened = fit.linear.whitened[:, members].reshape(-1)
            extension[:, number] = np.linalg.solve(normal, own @ whitened)
    first = [members[0] for members in poses]
    return PoseResidual(
        names=tuple(rows.pose_name[row] for row in first),
        position=situation.position[:, first],
        shift=shift,
        extension=extension,
        q=rows.q[:, first],
    )


def _displaced(fit: Fit) -> Array:
    """Smallest displacement (3, N) of each point that explains its residual, frame axes, mm."""
    slope, residual = fit.linear.situation.slope, fit.linear.residual
    if slope is None:
        return residual
    rows = fit.model.rows
    seen = np.moveaxis(slope * rows.live[:, None], -1, 0)
    own = residual * rows.live
    if rows.sensed is not None:
        own *= ~rows.sensed.turn
    return np.asarray(np.einsum("nij,jn->in", np.linalg.pinv(seen), own))


def _gathered(fit: Fit) -> Sequence[list[int]]:
    """Accepted platform readings of each pose: same run, label and commanded coordinates."""
    rows = fit.model.rows
    poses: dict[tuple[int, str, bytes], list[int]] = {}
    for row in np.flatnonzero(fit.accepted & rows.on_platform):
        key = (int(rows.run[row]), rows.pose_name[row], rows.q[:, row].tobytes())
        poses.setdefault(key, []).append(int(row))
    return list(poses.values())
