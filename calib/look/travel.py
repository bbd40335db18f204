"""Commanded coordinates against the travel: their unit, sign, reference and order."""

import numpy as np

from calib.arrays import Array
from calib.look.conventions import Misread
from calib.mechanism.description import Machine
from calib.runs.record import Run

OUTSIDE = 0.5
"""Part of the rows outside the travel from which on the columns are not what they should be."""
WIDER = 0.1
"""Part of the travel by which commands may pass a limit of the file."""
LEAST_TRAVEL = 0.02
"""Part of the travel that a run at least uses: where it is less, any small number would do."""
WIDER_BY = 2.0
"""How much more of the travel a later way of reading must use to be preferred."""
_LENGTHS = ((1000.0, "m"), (25.4, "inches"), (0.001, "um"), (10.0, "cm"))
_ANGLES = ((np.pi / 180.0, "degrees"), (0.001, "mrad"), (2.0 * np.pi, "turns"))


def check_travel(machine: Machine, run: Run) -> None:
    """Refuse coordinates that are nowhere near the travel; raises Misread naming what they are."""
    inside = _inside(machine, run.q)
    if inside.mean() >= 1.0 - OUTSIDE:
        return
    explained = _explained(machine, run.q)
    if not explained:
        _check_single(machine, run)
        return
    row = int(np.argmin(inside))
    first = machine.actuators[0]
    raise Misread(
        f"q1..q{len(machine.actuators)} are outside the travel of the actuators "
        f"({first.name}: {first.limits[0]:.4g} to {first.limits[1]:.4g} {first.unit}, here "
        f"{run.q[0, row]:.6g}); they look like {explained}",
        place=f"{run.source}, line {run.line[row]}",
        remedy=f"Write what the machine file calls q: {first.unit}, counted so that home is "
        f"{first.home:.6g}",
        of="q",
    )


def _check_single(machine: Machine, run: Run) -> None:
    """Refuse one column outside its travel while the others are inside theirs."""
    low, high = machine.q_limits.T[:, :, None]
    margin = WIDER * (high - low)
    good = np.mean((run.q >= low - margin) & (run.q <= high + margin), axis=1)
    odd = np.flatnonzero(good < OUTSIDE)
    if odd.size != 1 or good.size == 1 or np.delete(good, odd).min() < 0.95:
        return
    k = int(odd[0])
    axis = machine.actuators[k]
    factors = _LENGTHS if axis.unit == "mm" else _ANGLES
    tried = [(axis.home + run.q[k], "changes from home, not positions")]
    tried += [(factor * run.q[k], name) for factor, name in factors]
    tried += [(-run.q[k], "positions of the wrong sign")]
    tried += [(2.0 * axis.home - run.q[k], "positions of the wrong sign about home")]
    span = float(high[k, 0] - low[k, 0])
    likely = [
        (float(np.ptp(values)), name)
        for values, name in tried
        if np.mean((values >= low[k] - margin[k]) & (values <= high[k] + margin[k])) >= 0.95
        and np.ptp(values) / span > LEAST_TRAVEL
    ]
    look = f"; it looks like {max(likely)[1]}" if likely else ""
    raise Misread(
        f"q{k + 1} is outside the travel of {axis.name} ({axis.limits[0]:.4g} to "
        f"{axis.limits[1]:.4g} {axis.unit}) in most rows, the others are inside theirs{look}",
        place=f"{run.source}, line {run.line[0]}",
        remedy=f"Write q{k + 1} in {axis.unit}, counted so that home is {axis.home:.6g}",
        of="q",
    )


def _inside(machine: Machine, q: Array) -> Array:
    low, high = machine.q_limits.T[:, :, None]
    margin = WIDER * (high - low)
    return np.asarray(np.all((q >= low - margin) & (q <= high + margin), axis=0))


def _explained(machine: Machine, q: Array) -> str:
    """The first reading of the numbers that brings almost all of them into the travel."""
    units = [actuator.unit for actuator in machine.actuators]
    home = machine.home_q[:, None]
    tried: list[tuple[Array, str]] = [
        (home + q, "changes from home, not positions"),
        (-q, "positions of the wrong sign"),
        (home - q, "changes from home of the wrong sign"),
    ]
    for factors, of in ((_LENGTHS, "mm"), (_ANGLES, "rad")):
        if of not in units:
            continue
        for factor, name in factors:
            scale = np.array([factor if unit == of else 1.0 for unit in units])[:, None]
            tried.append((scale * q, name))
            tried.append((home + scale * q, f"changes from home in {name}"))
    best, most = "", LEAST_TRAVEL
    for values, name in tried:  # a run goes far: what leaves little of the travel is the wrong way
        wide = float(np.max(np.ptp(values, axis=1) / np.ptp(machine.q_limits, axis=1)))
        if wide > WIDER_BY * most and _inside(machine, values).mean() >= 0.95:
            best, most = name, wide
    if best:
        return best
    if _inside(machine, q[::-1]).mean() >= 0.95:
        return "the actuators in reversed order"
    return ""
