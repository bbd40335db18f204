"""A fit to a run as the linear core sees it: effects as candidates, state variables.

Components are ordered as (3, A) flattened: axis after axis over the accepted readings.
"""

from collections.abc import Callable, Sequence

import numpy as np

from calib.arrays import Array, BoolArray
from calib.effects.tracker import rigid_motions
from calib.evidence.candidate import Candidate, fill_missing, unit_errors
from calib.evidence.columns import Columns
from calib.evidence.problem import LinearProblem
from calib.evidence.quadratic import Neighbours, Quadratic, rigid_blocks
from calib.evidence.structure import Response, Variable
from calib.identify.fitting import Fit
from calib.identify.signatures import EffectColumns
from calib.mechanism.rigid import rotate, to_euler

LEGS, TIMES_Q = "legs", " times q"
"""What moves along with an actuator's own coordinate, in the name of what is moved."""
MANY = 400
"""Periods in time that are tried at most for what moves all points alike."""


def effect_candidates(
    fit: Fit, problem: LinearProblem, effects: Sequence[EffectColumns]
) -> list[Candidate]:
    """Effects as candidates over the accepted readings, in the order of ``effects``."""
    return [_candidate(fit, problem, one) for one in effects]


def _candidate(fit: Fit, problem: LinearProblem, one: EffectColumns) -> Candidate:
    missing = np.tile(~one.known[fit.accepted], 3)
    replaced = _replacing(fit, problem, missing) if missing.any() else None
    linear = tuple(unknown for unknown in one.unknowns if not unknown.nonlinear)

    def make(first: int, last: int) -> Array:
        derived = one.some(first, last)
        flat = fit.whiten(derived.reshape(-1, *derived.shape[2:]))
        made = flat.reshape(*derived.shape[:2], -1)
        return made if replaced is None else replaced(made)

    columns = Columns((len(one.trials), len(linear), 3 * fit.readings), make)
    subsets = one.effect.parts(fit.model.rows)
    return Candidate(one.effect.id, linear, columns, one.trials, subsets=subsets)


def _replacing(fit: Fit, problem: LinearProblem, missing: BoolArray) -> Callable[[Array], Array]:
    """What makes columns of some readings' components count no more, ``missing`` (3 A,)."""
    errors = unit_errors(missing)
    if fit.whitening is not None:
        freed = fit.whitening.apply(errors.reshape(errors.shape[0], 3, -1))
        errors = freed.reshape(errors.shape)
    return lambda made: fill_missing(problem, made, missing, errors)


def every_leg(fit: Fit) -> Response:
    """The extensions of all actuators, each in its own unit."""
    axes = fit.model.rows.machine.axes
    columns = accepted(fit, fit.linear.situation.actuator_columns)
    units = tuple(axis.unit for axis in axes)
    return Response(LEGS, columns, units, tuple(axis.usual_error for axis in axes))


def each_leg(fit: Fit) -> list[Response]:
    """The extension of one actuator, for every actuator."""
    legs = every_leg(fit)
    return [
        Response(f"leg{k + 1}", legs.columns[[k]], *legs.scale(k))
        for k in range(legs.columns.shape[0])
    ]


def accepted(fit: Fit, columns: Array) -> Array:
    """(..., 3, N) -> (..., 3 A), in stated sigmas, contiguous."""
    chosen = columns if fit.accepted.all() else columns[..., fit.accepted]
    return np.ascontiguousarray(chosen.reshape(*columns.shape[:-2], -1))


def _rows_of(fit: Fit, values: Array) -> Array:
    """State column (..., N) -> value of each component (..., 3 A)."""
    chosen = values[..., fit.accepted]
    return np.concatenate([chosen] * 3, axis=-1)


def variables_of(fit: Fit) -> list[Variable]:
    """Everything that the residual could depend on, with what it could act on."""
    rows, situation = fit.model.rows, fit.linear.situation
    legs, own, axes = every_leg(fit), each_leg(fit), rows.machine.axes
    points = Response(
        "point", accepted(fit, rows.folded(np.swapaxes(situation.whitener, 0, 1))), "mm", 0.01
    )
    found = [
        Variable(f"q{k + 1}", _rows_of(fit, s), (leg,), ("smooth", "periodic"), axis.shortest)
        for k, (s, leg, axis) in enumerate(zip(rows.extension, own, axes, strict=True))
    ]
    found.append(Variable("direction", _rows_of(fit, rows.direction), (legs,)))
    clock = _rows_of(fit, rows.time_s)
    found += [
        Variable("time_s", clock, (legs,), ("smooth", "periodic")),
        Variable("time_s", clock, (points,), ("smooth", "periodic"), most_periods=MANY),
    ]
    found += [
        Variable(name, _rows_of(fit, values), (legs, points))
        for name, values in rows.channels.items()
        if np.isfinite(values[fit.accepted]).all()
    ]
    found += [
        Variable(name, _rows_of(fit, values), (points,))
        for name, values in zip("xyz", situation.point, strict=True)
    ]
    coordinates = np.concatenate([situation.position, to_euler(situation.rotation)])
    found += [Variable("pose", _rows_of(fit, values), (legs,)) for values in coordinates]
    return found


def products_of(fit: Fit) -> list[Variable]:
    """Gains of the actuators that change with a column or with time: the product of both.

    No function of one variable shows them; each visit of a pose at another temperature, load or
    time would seem to err by chance.
    """
    rows, legs = fit.model.rows, every_leg(fit)
    gains = Response(f"{legs.name}{TIMES_Q}", legs.columns, legs.unit, legs.size)
    changing = {"time_s": rows.time_s, **rows.channels}
    found = []
    for name, values in changing.items():
        kept = values[fit.accepted]
        if not np.isfinite(kept).all() or np.ptp(kept) == 0.0:
            continue
        middle = 0.5 * (kept.min() + kept.max())
        found.append(
            Variable(name, _rows_of(fit, rows.extension * (values - middle)), (gains,), ("linear",))
        )
    return found


def quadratics_of(fit: Fit) -> list[Quadratic]:
    """Neighbours in time that err alike, poses that move as one."""
    rows, situation = fit.model.rows, fit.linear.situation
    count = fit.readings
    run, time = rows.run[fit.accepted], rows.time_s[fit.accepted]
    platform = rows.on_platform[fit.accepted]
    pair = np.flatnonzero(
        (run[1:] == run[:-1]) & (time[1:] > time[:-1]) & platform[1:] & platform[:-1]
    )
    found: list[Quadratic] = []
    if pair.size >= 10:
        axes = count * np.arange(3)[:, None]
        found.append(Neighbours((axes + pair).reshape(-1), (axes + pair + 1).reshape(-1)))
    motions = rigid_motions(situation.base_point - situation.position)
    turned = np.stack([rotate(situation.frame_rotation, one) for one in motions])
    whitened = rows.folded(np.einsum("ijn,ujn->uin", situation.whitener, turned))
    labels = [
        f"{run} {name}" if on else ""
        for run, name, on in zip(rows.run, rows.pose_name, rows.on_platform, strict=True)
    ]
    kept = [label for label, good in zip(labels, fit.accepted, strict=True) if good]
    blocks = rigid_blocks(kept * 3, accepted(fit, whitened))
    return [*found, blocks] if blocks is not None else found
