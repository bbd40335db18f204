"""What a fit leaves, asked of the record: a unit of the uncertainties, a step, a seat.

These are smaller than what the drawing's machine alone can show (a station moved by 0.2 mm, an
SMR 0.3 mm higher), so the fitted geometry is projected out.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.identify.fitting import Fit
from calib.look.bent import not_stated, rounded_commands, slip, slip_remark
from calib.look.gravity import gravity_elsewhere
from calib.look.many import several_steps
from calib.look.reflector import lifted_throughout, other_reflector
from calib.look.scan import fit_of, prior_cost, with_the_excluded
from calib.look.seat_off import reseated, seat_off
from calib.look.several import beyond_one_step, stepped_fit
from calib.look.shape import other_shape, stretched
from calib.look.sigmas import sigmas_of_all
from calib.look.steps import frame_step, step_remark
from calib.look.story import Story
from calib.look.table_frames import table_frame
from calib.mechanism.description import Machine
from calib.runs.record import Run

LOUD = 2.0
"""Chi-square per degree of freedom from which on the record itself is in question."""
BENT, BENT_TABLE = 2.5, 1.8
"""Cost of the priors a parameter from which on the geometry was bent to fit the record; and from
which on a table that is off as a whole is asked alone."""
LEAST = 3
"""Readings left out from which on they are looked at with the others."""
LOUDEST = 100.0
"""Chi-square per degree of freedom that physics may leave where the unit is right."""
_Known = Mapping[str, Array]


def look_at_misfit(machine: Machine, run: Run, known: _Known, *, alone: bool) -> Story:
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
    first = fit_of(machine, run, known)
    as_it_is = Story([run], [], known, first)
    if first is None or not first.dof > 0:
        return as_it_is
    fitted = with_the_excluded(first) if len(first.bad) > LEAST else first
    scatter = float(np.sqrt(fitted.chi2_per_dof))
    sigma = float(np.median(np.sqrt(np.einsum("iin->in", fitted.model.rows.covariance))))
    unit = sigmas_of_all(run, sigma, scatter)
    if unit is not None:
        again = fit_of(machine, unit.run, known)
        if again is not None and again.chi2_per_dof < LOUDEST:
            return Story([unit.run], [unit.remark], known, again)
    stated = not_stated(machine, run, fitted)
    if stated is not None:
        return Story([stated.run], [stated.remark], known)
    if not loud(fitted):
        tilted = _table_alone(machine, run, fitted)
        if tilted is not None:
            return tilted
        elsewhere = gravity_elsewhere(fitted)
        return as_it_is if elsewhere is None else Story([run], [elsewhere], known, first)
    if known:
        more = beyond_one_step(machine, run, fitted) if alone else None
        return as_it_is if more is None else Story(more[0], [more[1]], {})
    return (
        of_places(machine, run, fitted, alone=alone)
        or (_of_steps(machine, run) if alone else None)
        or _last(machine, run, fitted)
        or as_it_is
    )


def _table_alone(machine: Machine, run: Run, fitted: Fit) -> Story | None:
    """A table off as a whole, where nothing but the geometry shows it."""
    if prior_cost(fitted) < BENT_TABLE * fitted.model.free.size:
        return None
    mended = table_frame(machine, run, fitted)
    return None if mended is None else Story([mended.run], [mended.remark], {})


def loud(fitted: Fit) -> bool:
    """Whether readings scatter too much, or the geometry was bent too far, for a good record."""
    bent = prior_cost(fitted) > BENT * fitted.model.free.size
    return fitted.chi2_per_dof >= LOUD or bent


def of_places(machine: Machine, run: Run, fitted: Fit, *, alone: bool) -> Story | None:
    """What explains a misfit by itself: a step, a slip, a seat, a table; the clearest of them."""
    found = frame_step(fitted) if alone else None
    seat = seat_off(fitted)
    if found is not None and (seat is None or found.fall > seat.fall):
        stepped = stepped_fit(machine, run, found.values)
        more = None if stepped is None else beyond_one_step(machine, run, stepped)
        if more is not None:
            return Story(more[0], [more[1]], {})
        return Story([run], [step_remark(fitted, found)], {"frame-shift": found.values})
    slipped = slip(fitted) if alone else None
    if slipped is not None and (seat is None or slipped.fall > seat.fall):
        once = Story([run], [slip_remark(fitted, slipped)], {"actuator-step": slipped.values})
        again = fit_of(machine, run, once.known)
        loud_still = again is None or again.chi2_per_dof > LOUD
        both = _of_steps(machine, run) if loud_still else None
        return both or replace(once, fit=again)
    if seat is not None:
        moved, remark = reseated(machine, run, fitted, seat)
        return Story([moved], [remark], {})
    mended = table_frame(machine, run, fitted) or lifted_throughout(run, fitted)
    return None if mended is None else Story([mended.run], [mended.remark], {})


def each_of_places(machine: Machine, run: Run, fitted: Fit, *, alone: bool) -> list[Story]:
    """Each of those by itself, and another reflector: for trial against one another by fits."""
    found: list[Story] = []
    seat = seat_off(fitted)
    if seat is not None:
        moved, remark = reseated(machine, run, fitted, seat)
        found.append(Story([moved], [remark], {}))
    tried = (table_frame(machine, run, fitted), other_reflector(run, fitted))
    found += [Story([one.run], [one.remark], {}) for one in tried if one is not None]
    step, slipped = (frame_step(fitted), slip(fitted)) if alone else (None, None)
    if step is not None:
        found.append(Story([run], [step_remark(fitted, step)], {"frame-shift": step.values}))
    if slipped is not None:
        known = {"actuator-step": slipped.values}
        found.append(Story([run], [slip_remark(fitted, slipped)], known))
    return found


def _of_steps(machine: Machine, run: Run) -> Story | None:
    """Several steps of the frame and of actuators."""
    found = several_steps(machine, run)
    return None if found is None else Story(*found, {})


def _last(machine: Machine, run: Run, fitted: Fit) -> Story | None:
    """What is asked where nothing by itself explains a misfit."""
    shaped = stretched(run) or other_shape(machine, run)
    if shaped is not None:
        return Story([shaped.run], [shaped.remark], {})
    said = rounded_commands(run, fitted) or gravity_elsewhere(fitted)
    return None if said is None else Story([run], [said], {})
