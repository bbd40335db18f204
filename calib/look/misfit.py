"""What a fit leaves, asked of the record: a unit of the uncertainties, a step, a seat.

These are smaller than what the drawing's machine alone can show (a station moved by 0.2 mm, an
SMR 0.3 mm higher), so the fitted geometry is projected out.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from calib.arrays import Array, BoolArray
from calib.effects import effect_named
from calib.errors import BadInput
from calib.identify.fitting import Fit
from calib.identify.staged import fit_effects
from calib.look.bent import not_stated, rounded_commands, slip, slip_remark, table_frame
from calib.look.gravity import gravity_elsewhere
from calib.look.scan import excess, prior_cost, scan, with_the_excluded
from calib.look.seats import ALONG, lifted, normal_of, seated
from calib.look.several import beyond_one_step, stepped_fit
from calib.look.sigmas import sigmas_of_all
from calib.look.steps import frame_step, step_remark
from calib.mechanism.description import Machine
from calib.mechanism.rigid import rotate
from calib.runs.record import Run
from calib.runs.remark import Remark
from calib.runs.stack import stack

LOUD = 2.0
"""Chi-square per degree of freedom from which on the record itself is in question."""
BENT = 2.5
"""Cost of the priors a parameter from which on the geometry was bent to fit the record."""
FALL = 100.0
"""Least fall of chi-square by which a step or a seat is held."""
SHARE = 0.6
"""Least part of the misfit that a step must explain."""
SEAT_SHARE = 0.9
"""Least part of the misfit that a seat must explain: angles of the tracker bend nests alike."""
CLEAR = 30.0
"""Fall of chi-square by which it must beat what else could step at that moment."""
LEAST = 3
"""Readings on either side of a step."""
SMALLEST_SEAT, SMALLEST_ASIDE = 0.3, 0.5
"""Offset of a nest, mm, below which it is a matter of the effect nest-offset; and off its normal.

No reflector makes an offset that is not along the normal: there it must be larger, and explain all.
"""
ASIDE_SHARE = 0.97
LOUDEST = 100.0
"""Chi-square per degree of freedom that physics may leave where the unit is right."""
_Known = Mapping[str, Array]


def look_at_misfit(
    machine: Machine, run: Run, known: _Known, *, alone: bool
) -> tuple[list[Run], list[Remark], _Known]:
    """Fit a run as it is meant by now, and look at what is left.

    Parameters
    ----------
    machine : Machine
    run : Run
    known : mapping
        Effects that the record has shown by now.
    alone : bool
        Whether this is the only run: a step is then an effect of the model.
    """
    fitted = _fit(machine, run, known)
    if fitted is None or not fitted.dof > 0:
        return [run], [], {}
    if len(fitted.bad) > LEAST:
        fitted = with_the_excluded(fitted)
    scatter = float(np.sqrt(fitted.chi2_per_dof))
    sigma = float(np.median(np.sqrt(np.einsum("iin->in", fitted.model.rows.covariance))))
    unit = sigmas_of_all(run, sigma, scatter)
    if unit is not None:
        again = _fit(machine, unit.run, known)
        if again is not None and again.chi2_per_dof < LOUDEST:
            return [unit.run], [unit.remark], {}
    stated = not_stated(machine, run, fitted)
    if stated is not None:
        return [stated.run], [stated.remark], {}
    bent = prior_cost(fitted) > BENT * fitted.model.free.size
    if fitted.chi2_per_dof < LOUD and not bent:
        elsewhere = gravity_elsewhere(fitted)
        return [run], [] if elsewhere is None else [elsewhere], {}
    if known:
        more = beyond_one_step(machine, run, fitted) if alone else None
        return ([run], [], {}) if more is None else (more[0], [more[1]], {})
    found = frame_step(fitted) if alone else None
    seat = _seat(fitted)
    if found is not None and (seat is None or found.fall > seat.fall):
        stepped = stepped_fit(machine, run, found.values)
        more = None if stepped is None else beyond_one_step(machine, run, stepped)
        if more is not None:
            return more[0], [more[1]], {}
        return [run], [step_remark(fitted, found)], {"frame-shift": found.values}
    slipped = slip(fitted) if alone else None
    if slipped is not None and (seat is None or slipped.fall > seat.fall):
        return [run], [slip_remark(fitted, slipped)], {"actuator-step": slipped.values}
    if seat is not None:
        return _seated(machine, run, fitted, seat)
    mended = table_frame(machine, run, fitted)
    if mended is not None:
        return [mended.run], [mended.remark], {}
    rounded = rounded_commands(run, fitted)
    return [run], [] if rounded is None else [rounded], {}


def _fit(machine: Machine, run: Run, known: _Known) -> Fit | None:
    try:
        rows = replace(stack(machine, [run]), known=known)
        return fit_effects(rows, [effect_named(name, machine) for name in known])
    except BadInput:
        return None  # the fit that was asked for says it


@dataclass(frozen=True, eq=False)
class _Seat:
    """A nest that is off by ``offset`` (3,) mm in the rows ``which`` (N,).

    ``room``: in the base frame, whatever the platform does; else in the platform frame.
    """

    name: str
    room: bool
    which: BoolArray
    offset: Array
    fall: float


def _seat(fitted: Fit) -> _Seat | None:
    """The nest whose offset, in the whole run or a part, explains the misfit."""
    rows = fitted.model.rows
    header = rows.runs[0].header
    names = np.array(rows.nest_name, dtype=object)
    kept = np.flatnonzero(fitted.accepted)
    best: _Seat | None = None
    for name in header.platform_nests:
        named = names == name
        own = named & fitted.accepted
        at = np.flatnonzero(own[kept])
        if at.size <= LEAST:
            continue
        for room, early in product((False, True), (False, True)):
            normal = np.array([0.0, 0.0, 1.0]) if room else normal_of(header)
            tried = at[LEAST:] if early else at[: at.size - LEAST]
            tries = scan(fitted, _seat_columns(fitted, own, room=room), early=early)
            edge = int(tried[np.argmax(tries.fall[tried])])
            whole = int(at[-1] if early else at[0])
            if tries.fall[whole] > tries.fall[edge] - CLEAR:
                edge = whole
            which = named & ((np.arange(own.size) <= kept[edge]) == early)
            which[kept[edge]] = True
            if edge == whole:
                which = named
            found = _Seat(name, room, which, tries.sizes[edge], float(tries.fall[edge]))
            if not _seems_moved(found, normal, excess(fitted)):
                continue
            if best is None or found.fall > best.fall:
                best = found
    return best


def _seems_moved(seat: _Seat, normal: Array, misfit: float) -> bool:
    """Whether an offset is large enough, and explains enough of a misfit, to be of the record."""
    size = float(np.linalg.norm(seat.offset))
    along = abs(float(normal @ seat.offset)) >= ALONG * size
    least, share = (SMALLEST_SEAT, SEAT_SHARE) if along else (SMALLEST_ASIDE, ASIDE_SHARE)
    return size >= least and seat.fall >= max(FALL, share * misfit)


def _seat_columns(fitted: Fit, which: BoolArray, *, room: bool) -> Array:
    """Whitened columns (3, 3, A) of moving the SMR of some readings, platform or base frame."""
    situation = fitted.linear.situation
    unit = np.repeat(np.eye(3)[:, :, None], which.size, axis=2) * which
    turned = unit if room else np.stack([rotate(situation.rotation, one) for one in unit])
    whitened = np.einsum("ijn,kjn->kin", situation.whitened_frame, turned)
    return np.asarray(whitened[:, :, fitted.accepted], dtype=np.float64)


def _seated(
    machine: Machine, run: Run, fitted: Fit, seat: _Seat
) -> tuple[list[Run], list[Remark], _Known]:
    """Move the nest to where it was read; a second fit corrects what the first one was bent by."""
    lines = fitted.model.rows.line[seat.which]
    frame = fitted.linear.state.frame_rotation[:, :, 0]

    def taken(offset: Array) -> tuple[Run, Remark]:
        if seat.room:
            return lifted(run, seat.name, lines, offset, frame)
        return seated(run, seat.name, lines, offset)

    moved, remark = taken(seat.offset)
    again = _fit(machine, moved, {})
    if again is not None:
        here = np.isin(again.model.rows.line, lines)
        more = scan(again, _seat_columns(again, here, room=seat.room)).sizes[0]
        moved, remark = taken(seat.offset + more)
    return [moved], [remark], {}


def seat_refined(machine: Machine, before: Run, run: Run) -> Run:
    """The run with a seat, which was seen by the nominal machine, where a fit puts it."""
    old, table = before.header.platform_nests, run.header.platform_nests
    names = [n for n in table if n not in old or not np.array_equal(old[n], table[n])]
    fitted = _fit(machine, run, {}) if len(names) == 1 else None
    if fitted is None:
        return run
    which = np.array([nest == names[0] for nest in fitted.model.rows.nest_name])
    more = scan(fitted, _seat_columns(fitted, which & fitted.accepted, room=False)).sizes[0]
    moved = {**table, names[0]: table[names[0]] + more}
    return replace(run, header=replace(run.header, platform_nests=moved))
