"""Where a fit begins: nominal machine, frames by alignment; readings that are in no such place."""

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.errors import BadInput
from calib.frames import align
from calib.identify.alignment import collinear, misfit, moved_together, robust_align
from calib.identify.readings import BadReading, wrong_place
from calib.mechanism.rigid import from_euler, rotate
from calib.mechanism.solve import forward
from calib.model.prediction import Model
from calib.model.state import Linearised, State

MAJORITY = 0.3
"""Least part of a run's readings that must stand where the machine's nests can be."""

NOWHERE = "are where a nest can be"
"""Said of a run of which too few readings stand where they can."""
AT_REST = 0.1
"""How far the nests on the base may wander during a run and count as at rest, mm."""
TOGETHER = 2000
"""Readings that are weighed at once."""
MOVED = ", moved as one with others: the tracker or the base was moved during the run"
"""Said of readings outside that fit one another; a run from there on is a run of its own."""


def begin(model: Model, allowed: BoolArray) -> tuple[Linearised, list[BadReading]]:
    """Start at the nominal machine, frames by rigid alignment; and readings in no such place.

    Raises
    ------
    BadInput
        If too few readings stand where the machine's nests can be.
    """
    base = model.base_points()
    state, linear = aligned(model, base, allowed)
    slack = slack_of(model, linear)
    apart = np.sqrt(np.sum(linear.residual**2, axis=0))
    placed = allowed & model.rows.placed
    if np.all(apart[placed] < slack[placed]):
        return linear, []
    state, bad = _aligned_robustly(model, base, placed, slack)
    return model.linearise(state), bad


def aligned(model: Model, base: Array, allowed: BoolArray) -> tuple[State, Linearised]:
    """Align all readings of each run."""
    rows = model.rows
    rotation, position = np.zeros((3, 3, model.frames)), np.zeros((3, model.frames))
    for run in range(model.frames):
        here = np.flatnonzero((rows.frame == run) & allowed & rows.placed)
        if collinear(base[:, here]) and (near := rows.frames[run].near) is not None:
            rotation[:, :, run], position[:, run] = from_euler(*near[3:]), near[:3]
            continue
        if collinear(base[:, here]):
            raise BadInput(
                f"{here.size} readings, all on one line, cannot tie {_instrument(model, run)} to "
                "the machine",
                place=rows.runs[rows.frames[run].run].source,
                remedy="Expected readings at three places at least that are not on one line"
                + _or_near(model, run),
            )
        rotation[:, :, run], position[:, run] = align(base[:, here], rows.position[:, here])
    state = model.start(rotation, position)
    return state, model.linearise(state)


def _instrument(model: Model, frame: int) -> str:
    return model.rows.frames[frame].instrument or "the tracker"


def _or_near(model: Model, frame: int) -> str:
    name = model.rows.frames[frame].instrument
    if not name:
        return ""
    return (
        f"; or say in [instruments.{name}] roughly where it stands: near = [x, y, z, rx, ry, rz], "
        'the base in its frame; or frame = "base"'
    )


def _aligned_robustly(
    model: Model, base: Array, allowed: BoolArray, slack: Array
) -> tuple[State, list[BadReading]]:
    """Align the majority of each run's readings, and name the others."""
    rows = model.rows
    rotation, position = np.zeros((3, 3, model.frames)), np.zeros((3, model.frames))
    bad: list[BadReading] = []
    for run in range(model.frames):
        here = np.flatnonzero((rows.frame == run) & allowed)
        if here.size < 3 and (near := rows.frames[run].near) is not None:
            rotation[:, :, run], position[:, run] = from_euler(*near[3:]), near[:3]
            continue
        slack[here] += disagreement(model, base, here, slack)
        R, t, inside = robust_align(base[:, here], rows.position[:, here], slack[here])
        if inside.sum() < max(6, MAJORITY * here.size) and inside.sum() < here.size:
            raise BadInput(
                f"only {inside.sum()} of {here.size} readings {NOWHERE}"
                + _seen_from_base(model, base, here, slack),
                place=rows.runs[rows.frames[run].run].source,
                remedy="Check the machine, the units (mm), the nests in run.toml, and whether the "
                "column nest names the hole that the SMR was in",
            )
        rotation[:, :, run], position[:, run] = R, t
        outside = here[~inside]
        moved = moved_together(base[:, outside], rows.position[:, outside], slack[outside])
        for row, along in zip(outside, moved, strict=True):
            expected = _expected(model, int(row), R, t)
            why = wrong_place(rows, int(row), expected, slack[row])
            if along and "no other nest" in why:
                why += MOVED
            bad.append(bad_reading(model, int(row), why))
    return model.start(rotation, position), bad


def disagreement(model: Model, base: Array, here: IntArray, slack: Array) -> float:
    """How far (mm) the nominal machine is off as a whole, seen from the nests on the base.

    These are exact and know no machine: where they fit one another at every visit, and not the
    majority of readings on the platform, the machine is not as its file says; no reading is wrong.
    """
    rows = model.rows
    fixed = here[~rows.on_platform[here]]
    if collinear(base[:, fixed]):
        return 0.0
    own = align(base[:, fixed], rows.position[:, fixed])
    noise = np.sqrt(np.einsum("iin->n", rows.covariance[:, :, fixed]))
    if np.any(misfit(base[:, fixed], rows.position[:, fixed], *own) > 6.0 * noise + AT_REST):
        return 0.0
    R, t, _ = robust_align(base[:, here], rows.position[:, here], slack[here])
    apart = misfit(base[:, fixed], rows.position[:, fixed], R, t)
    worst = float(apart.max())
    return (
        1.2 * worst
        if np.all(apart > slack[fixed]) and worst < 0.5 * _spacing(base[:, fixed])
        else 0.0
    )


def _seen_from_base(model: Model, base: Array, here: IntArray, slack: Array) -> str:
    """The first reading on the platform that stands in another hole, seen from the base; or ''."""
    rows = model.rows
    fixed = here[~rows.on_platform[here]]
    if collinear(base[:, fixed]):
        return ""
    R, t = align(base[:, fixed], rows.position[:, fixed])
    for row in here[rows.on_platform[here]]:
        why = wrong_place(rows, int(row), _expected(model, int(row), R, t), slack[row])
        if why.startswith("reads as"):
            return f"; line {rows.line[row]} {why}"
    return ""


def _spacing(points: Array) -> float:
    """Least distance, mm, between points (3, N) that are not the same."""
    apart = np.linalg.norm(points[:, :, None] - points[:, None, :], axis=0)
    return float(apart[apart > 1e-6].min())


def _expected(model: Model, row: int, R: Array, t: Array) -> dict[str, Array]:
    """Where every nest of the run stood at one reading, by the nominal machine."""
    rows = model.rows
    header = rows.runs[rows.run[row]].header
    pose = forward(model.machine, rows.extension[:, [row]]).poses
    places = {
        name: pose.position[:, 0] + rotate(pose.rotation[:, :, 0], nest)
        for name, nest in header.platform_nests.items()
    }
    places.update(header.base_nests)
    return {name: R @ place + t for name, place in places.items()}


def slack_of(model: Model, linear: Linearised) -> Array:
    """How far (N,) a good reading may be from the aligned nominal machine, mm.

    Six sigmas of what the tolerances can do, the alignment's share included, plus a millimetre
    for effects that nobody has modelled.
    """
    sigma = model.machine.prior_sigma[model.free][: len(linear.jacobian), None, None]
    spread = np.zeros(model.rows.count)
    for first in range(0, spread.size, TOGETHER):
        part = slice(first, first + TOGETHER)
        moved = model.rows.in_mm(sigma * linear.jacobian[: len(sigma), :, part], part)
        spread[part] = np.sqrt(np.square(moved, out=moved).sum(axis=(0, 1)))
    variances = np.einsum("iin->in", model.rows.covariance)
    noise = np.sqrt(np.sum(np.where(model.rows.in_millimetres, variances, 0.0), axis=0))
    return np.asarray(1.0 + 6.0 * (np.maximum(spread, np.median(spread)) + noise))


def bad_reading(model: Model, row: int, why: str) -> BadReading:
    """A reading that is excluded, with its run and line."""
    return BadReading(row, int(model.rows.run[row]), int(model.rows.line[row]), why)
