"""Another reflector from some reading on: every nest is off alike, along its normal or the beam.

One number explains what a station that moved would need six for.
"""

from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.identify.fitting import Fit
from calib.look.bent import Mended
from calib.look.scan import excess, scan
from calib.look.seats import normal_of, radii_in_words
from calib.mechanism.rigid import rotate
from calib.runs.record import Run
from calib.runs.remark import Remark, ranges

FALL = 100.0
"""Least fall of the cost by which it is held."""
SHARE = 0.9
"""Least part of what is too much that it must explain."""
CLEAR = 30.0
"""Fall by which a moment must beat the whole run."""
LEAST = 3
"""Readings on either side of the moment."""
SMALLEST_MM, LARGEST_MM = 0.3, 40.0
"""Offset, mm, below which it is a matter of effects, and beyond which it is no reflector."""


def other_reflector(run: Run, fitted: Fit) -> Mended | None:
    """The one offset of all readings from some moment on that explains the misfit.

    ``fitted`` is without effects, of all readings. The offset is that of a first step: what is left
    is found by asking again.
    """
    best: tuple[float, str, int, float, Array] | None = None
    kept = np.flatnonzero(fitted.accepted)
    inner = slice(LEAST, kept.size - LEAST + 1)
    for kind, way in (("lift", _upright(fitted)), ("range", _along(fitted))):
        columns = np.einsum("ijn,jn->in", fitted.model.rows.whitener, way)[None]
        tried = scan(fitted, columns[:, :, fitted.accepted])
        if tried.fall[inner].size == 0:
            return None
        at = int(np.argmax(tried.fall[inner])) + LEAST
        if kind == "lift" and tried.fall[0] > tried.fall[at] - CLEAR:
            at = 0  # throughout
        if best is None or tried.fall[at] > best[0]:
            row = int(kept[at]) if at else 0
            best = (float(tried.fall[at]), kind, row, float(tried.sizes[at, 0]), way)
    if (
        best is None
        or best[0] < max(FALL, SHARE * excess(fitted))
        or not (SMALLEST_MM < abs(best[3]) < LARGEST_MM)
    ):
        return None
    _, kind, row, size, way = best
    read = np.flatnonzero(run.measured)
    position = run.position.copy()
    position[:, read[row:]] -= size * way[:, row:]
    return Mended(replace(run, position=position), _remark(fitted, kind, row, size))


def lifted_throughout(run: Run, fitted: Fit) -> Mended | None:
    """The same where all nests were read so in the whole run; nothing else."""
    found = other_reflector(run, fitted)
    return None if found is None or found.remark.lines else found


def _upright(fitted: Fit) -> Array:
    """Normals (3, N) of the nests, tracker frame: of the platform's table, and z of the base."""
    situation, rows = fitted.linear.situation, fitted.model.rows
    normal = np.tile(normal_of(rows.runs[0].header)[:, None], rows.count)
    up = np.tile(np.array([[0.0], [0.0], [1.0]]), rows.count)
    base = np.where(rows.on_platform, rotate(situation.rotation, normal), up)
    return rotate(situation.frame_rotation, base)


def _along(fitted: Fit) -> Array:
    """Directions (3, N) of the beam, tracker frame."""
    position = fitted.model.rows.position
    return np.asarray(position / np.linalg.norm(position, axis=0))


def _remark(fitted: Fit, kind: str, row: int, size: float) -> Remark:
    rows = fitted.model.rows
    line = rows.line[row]
    if kind == "lift":
        name = "smr-size"
        when = f"From line {line} on" if row else "Throughout"
        says = (
            f"{when} an SMR of another size was read in all nests: {size:+.3f} mm "
            f"along their normals{radii_in_words(abs(size))}"
        )
    else:
        name = "range-step"
        says = (
            f"From line {line} on all ranges are off by {size:+.3f} mm: another reflector was "
            "chosen in the tracker's program, or its constant was changed"
        )
    return Remark(
        name,
        says,
        ranges(rows.line[row:], rows.line) if row else (),
        "One number explains it; a station that moved needs six and does so worse"
        if row
        else "One number explains it: with the tables as they stand no machine within its "
        "tolerances does",
        "Read with that taken back; nothing is excluded for it",
        "Read all nests with one reflector, and tell the tracker's program which"
        if row
        else "Give the nest tables for the SMR that was read, or tell the tracker's program which",
        True,
        rows.runs[0].source,
    )
