"""Where one step of the frame is not the whole story: another reflector, or several steps."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from calib.effects import effect_named
from calib.errors import BadInput
from calib.identify.fitting import Fit
from calib.identify.staged import fit_effects
from calib.look.reflector import other_reflector
from calib.look.scan import excess, fit_together, from_nominal, with_the_excluded
from calib.look.steps import frame_step
from calib.mechanism.description import Machine
from calib.runs.record import Run
from calib.runs.remark import Remark, ranges
from calib.runs.stack import stack

MOST_STEPS = 4
SHARE_OF_SEVERAL = 0.3
"""Least part of a misfit that one of several steps must explain."""
LEFT = 1.3
"""Chi-square per degree of freedom up to which one step is the whole story."""
LOUD = 2.0
"""Chi-square per degree of freedom from which on something is left."""
PASSES = 2
"""Times the offset of a reflector is found, the geometry freed of it in between."""


def beyond_one_step(machine: Machine, run: Run, stepped: Fit) -> tuple[list[Run], Remark] | None:
    """What explains a run better than the one step of the frame that ``stepped`` has.

    Returns the run, or its parts with frames of their own, and what is said; None if nothing does.
    """
    if stepped.chi2_per_dof < LEFT:
        return None
    best = _reflector(machine, run, stepped)
    if best is not None:
        return best
    if stepped.chi2_per_dof < LOUD:
        return None
    return _parts(machine, run, stepped)


def _reflector(machine: Machine, run: Run, stepped: Fit) -> tuple[list[Run], Remark] | None:
    said: Remark | None = None
    meant = run
    fitted = fit_together(machine, [run])
    for _ in range(PASSES):
        if fitted is None:
            return None
        found = other_reflector(meant, with_the_excluded(fitted))
        if found is None:
            break
        said = said or found.remark
        meant = found.run
        fitted = fit_together(machine, [meant])
    if said is None or fitted is None or excess(fitted) > excess(stepped) - 6.0:
        return None
    if len(fitted.bad) > len(stepped.bad):
        return None
    return [meant], said


def parted(machine: Machine, run: Run) -> tuple[list[Run], Remark] | None:
    """The run in parts, the steps found one by one from the nominal machine; None for one part.

    Where there are several steps, an optimum with one of them is bent by the others.
    """
    edges: list[int] = []
    parts = [run]
    while len(edges) < MOST_STEPS:
        view = from_nominal(machine, parts)
        if view is None:
            return None
        found = frame_step(view, SHARE_OF_SEVERAL)
        if found is None or found.row in edges:
            break
        edges = sorted([*edges, found.row])
        parts = split(run, edges)
    whole, fitted = from_nominal(machine, [run]), fit_together(machine, parts)
    if len(edges) < 2 or fitted is None or whole is None:
        return None
    return parts, _parts_remark(run, whole, edges, fitted)


def _parts(machine: Machine, run: Run, stepped: Fit) -> tuple[list[Run], Remark] | None:
    """The run in parts, the steps found one by one; where each is needed."""
    rows = stepped.model.rows
    moment = float(rows.known["frame-shift"][6])
    edges = [int(np.argmax(rows.moment >= moment))]
    fitted = stepped
    parts = [run]
    while len(edges) < MOST_STEPS:
        parts = split(run, edges)
        again = fit_together(machine, parts)
        if again is None:
            return None
        fitted = with_the_excluded(again)
        if fitted.chi2_per_dof < LOUD:
            break
        found = frame_step(fitted)
        if found is None or found.row in edges:
            break
        edges = sorted([*edges, found.row])
    if len(edges) < 2 or fitted.chi2_per_dof > LOUD:
        return None
    return parts, _parts_remark(run, stepped, edges, fitted)


def _parts_remark(run: Run, stepped: Fit, edges: list[int], fitted: Fit) -> Remark:
    rows = stepped.model.rows
    told = " and ".join(
        f"before line {rows.line[edge]} ({rows.time_s[edge]:.0f} s)" for edge in edges
    )
    return Remark(
        "station-moved",
        f"The tracker or the base was moved during the run, {told}",
        ranges(rows.line[edges[0] :], rows.line),
        f"With {len(edges) + 1} frames chi-square per degree of freedom is "
        f"{fitted.chi2_per_dof:.3g}, with fewer it is {stepped.chi2_per_dof:.3g}",
        "The parts between the steps have frames of their own; nothing is excluded for it",
        "Nothing, or begin a new run after each move; fasten what was moved",
        True,
        run.source,
    )


def split(run: Run, edges: list[int]) -> list[Run]:
    """The run in parts before and after the readings ``edges``, each with the whole way."""
    read = np.flatnonzero(run.measured)
    parts = []
    for first, last in pairwise([0, *edges, read.size]):
        measured = np.zeros_like(run.measured)
        measured[read[first:last]] = True
        parts.append(replace(run, measured=measured))
    return parts


def stepped_fit(machine: Machine, run: Run, values: np.ndarray) -> Fit | None:
    """A fit with the step of the frame that was found."""
    rows = replace(stack(machine, [run]), known={"frame-shift": values})
    try:
        return fit_effects(rows, [effect_named("frame-shift", machine)])
    except BadInput:
        return None
