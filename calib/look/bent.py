"""A geometry bent to fit a record: an actuator that slipped, a table in another frame, rounding.

Each is tried against the fit as it stands by what freeing it would lower the cost by
(:mod:`calib.look.scan`); it must explain most of what is too much, by itself.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array
from calib.identify.fitting import Fit
from calib.look.digits import decimals_of
from calib.look.gravity import weight_fall
from calib.look.scan import excess, fit_of, scan
from calib.look.seat_off import each_seat
from calib.mechanism.description import Machine
from calib.runs.record import Run
from calib.runs.remark import Remark, ranges

FALL = 100.0
"""Least fall of the cost by which such a hypothesis is held."""
SLIP_SHARE = 0.9
"""Least part of what is too much that a slip must explain."""
NOT_STATED = 40.0
"""Fall of the cost by which the machine file's values must be better than those stated."""
LOUD = 2.0
"""Chi-square per degree of freedom up to which a fit is one of the whole record."""
CLEAR = 20.0
"""Fall by which a slip must beat a slow drift of the same actuator."""
SLOW_S = (300.0, 1200.0, 4800.0)
"""Time constants, s, with which an actuator may warm up."""
LEAST = 3
"""Readings on either side of a step."""
NEAR = 3.0
"""Times by which the misfit may differ from what rounding predicts."""
_Known = Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class Slip:
    """One actuator off from accepted reading ``row`` on: values of ``actuator-step``."""

    row: int
    actuator: int
    values: Array
    fall: float


def slip(fitted: Fit) -> Slip | None:
    """The one actuator whose step at one moment explains most of the misfit."""
    rows, kept = fitted.model.rows, np.flatnonzero(fitted.accepted)
    inner = slice(LEAST, kept.size - LEAST + 1)
    best: Slip | None = None
    for k in range(len(rows.machine.actuators)):
        columns = fitted.linear.situation.actuator_columns[[k]][:, :, fitted.accepted]
        tried = scan(fitted, columns)
        if tried.fall[inner].size == 0:
            return None
        at = int(np.argmax(tried.fall[inner])) + LEAST
        fall = float(tried.fall[at])
        if best is None or fall > best.fall:
            values = np.zeros(len(rows.machine.actuators) + 1)
            values[k] = tried.sizes[at, 0]
            values[-1] = 0.5 * (rows.time_s[kept[at - 1]] + rows.time_s[kept[at]])
            best = Slip(int(kept[at]), k, values, fall)
    if best is None or best.fall < max(FALL, SLIP_SHARE * excess(fitted)):
        return None
    rivals = (_slow(fitted, best.actuator), _of_a_nest(fitted), weight_fall(fitted))
    if best.fall < max(rivals) + CLEAR or _put_on(fitted, best.row):
        return None
    late = fitted.model.rows.time_s >= best.values[-1]
    return best if 0 < int(late.sum()) < late.size else None


def _put_on(fitted: Fit, row: int) -> bool:
    """Whether a payload was put on or taken off at that reading: what follows is its weight."""
    payload = fitted.model.rows.channels.get("payload_kg")
    before = np.flatnonzero(fitted.accepted[:row])
    return payload is not None and before.size > 0 and payload[row] != payload[before[-1]]


def _slow(fitted: Fit, actuator: int) -> float:
    """Fall of the cost if that actuator drifts slowly instead: it warms up, or creeps."""
    rows = fitted.model.rows
    temperature = rows.channels.get("structure_temp_C", rows.progress)
    if not np.all(np.isfinite(temperature)):
        temperature = rows.progress**2
    shapes = [rows.progress, temperature - temperature.mean()]
    shapes += [np.exp(-rows.time_s / tau) for tau in SLOW_S]
    column = fitted.linear.situation.actuator_columns[actuator]
    columns = np.stack([column * shape for shape in shapes])[:, :, fitted.accepted]
    return float(scan(fitted, columns).fall[0])


def _of_a_nest(fitted: Fit) -> float:
    """Fall by the one nest that is off throughout: read in turn, nests step like an actuator."""
    return max((float(scan(fitted, one).fall[0]) for one in each_seat(fitted)), default=0.0)


def slip_remark(fitted: Fit, found: Slip) -> Remark:
    """What is said of a slip."""
    rows = fitted.model.rows
    axis = rows.machine.actuators[found.actuator]
    size = float(found.values[found.actuator])
    part = 100.0 * found.fall / max(excess(fitted), found.fall)
    return Remark(
        "actuator-slipped",
        f"{axis.name} is off by {size:+.3g} {axis.unit} from line {rows.line[found.row]} on "
        f"({rows.time_s[found.row]:.0f} s): it slipped, or lost counts",
        ranges(rows.line[found.row :], rows.line),
        f"One step of this actuator alone explains {part:.0f} % of the misfit",
        "The step is in the model as actuator-step; nothing is excluded for it",
        f"See {axis.name} and its drive, home it, and measure again from there on",
        True,
        rows.runs[0].source,
    )


@dataclass(frozen=True, eq=False)
class Mended:
    """A run as it is meant, and what is said of it."""

    run: Run
    remark: Remark


def not_stated(machine: Machine, run: Run, fitted: Fit) -> Mended | None:
    """Controller parameters that the readings contradict, and the nominal ones do not."""
    if not run.header.controller_parameters or fitted.model.rows.known:
        return None
    nominal = replace(run, header=replace(run.header, controller_parameters={}))
    again = fit_of(machine, nominal)
    if again is None:
        return None
    fall = excess(fitted) - excess(again)
    if fall < NOT_STATED or again.chi2_per_dof > max(LOUD, fitted.chi2_per_dof):
        return None
    names = ", ".join(list(run.header.controller_parameters)[:4])
    return Mended(
        nominal,
        Remark(
            "controller-parameters",
            f"The controller did not hold what [controller.parameters] states ({names} ...)",
            (),
            "With the machine file's own values the geometry is within its tolerances, with those "
            f"stated it is not (the cost of the fit falls by {fall:.3g})",
            "Fitted with the machine file's own values",
            "State the parameters with which the controller moved while this run was measured",
            True,
            run.source,
        ),
    )


def rounded_commands(run: Run, fitted: Fit) -> Remark | None:
    """q with so few digits that rounding alone would make the misfit there is."""
    rows = fitted.model.rows
    on = rows.on_platform & fitted.accepted
    step = 10.0 ** -decimals_of(rows.q[:, on])
    columns = fitted.linear.situation.actuator_columns[:, :, on]
    expected = 1.0 + float(np.sum(columns**2)) * step**2 / 12.0 / (3.0 * on.sum())
    if expected < NEAR or not 1.0 / NEAR < fitted.chi2_per_dof / expected < NEAR:
        return None
    unit = rows.machine.actuators[0].unit
    return Remark(
        "q-rounded",
        f"q1.. are rounded to {step:g} {unit}, and the readings scatter as much as that makes them",
        (),
        f"Rounding predicts a chi-square of {expected:.3g} per degree of freedom; it is "
        f"{fitted.chi2_per_dof:.3g}",
        "Taken as it stands; small effects cannot be told from the rounding",
        "Write the commands with all their digits, as they were sent",
        False,
        run.source,
    )
