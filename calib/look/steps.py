"""A step of the frame at some moment, told from all else that may step there."""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.digits import length
from calib.effects.tracker import rigid_motions
from calib.identify.fitting import Fit
from calib.look.gravity import weight_fall
from calib.look.scan import excess, scan, whitened, with_the_excluded
from calib.mechanism.rigid import rotate
from calib.runs.remark import Remark, ranges

FALL = 100.0
"""Least fall of the cost by which a step is held."""
SHARE = 0.6
"""Least part of the misfit that a step must explain."""
CLEAR = 30.0
"""Fall by which it must beat what else could step at that moment."""
LEAST = 3
"""Readings on either side of a step."""


@dataclass(frozen=True, eq=False)
class FrameStep:
    """A frame that steps: the row, the values of ``frame-shift``, and what it explains."""

    row: int
    values: Array
    fall: float
    or_tool: bool = False
    """Whether the nests on the platform, moved as one, would explain it as well."""


def frame_step(fitted: Fit, share: float = SHARE) -> FrameStep | None:
    """A step of the base that explains most of the misfit, better than anything else that steps.

    ``share``: least part of the misfit, where several steps share it.
    """
    situation, rows = fitted.linear.situation, fitted.model.rows
    kept = np.flatnonzero(fitted.accepted)
    inner = slice(LEAST, kept.size - LEAST + 1)
    base = scan(fitted, whitened(fitted, rigid_motions(situation.base_point)))
    fall = base.fall[inner]
    if fall.size == 0:
        return None
    at = int(np.argmax(fall)) + LEAST
    best = float(base.fall[at])
    if best < max(FALL, share * excess(fitted)):
        return None
    others = [situation.actuator_columns[[k]] for k in range(len(rows.machine.actuators))]
    tool = rigid_motions(rows.nest) * rows.on_platform
    turned = np.stack([rotate(situation.rotation, one) for one in tool])
    others.append(np.einsum("ijn,kjn->kin", situation.whitened_frame, turned))
    rivals = [scan(fitted, one[:, :, fitted.accepted]).fall[inner].max() for one in others]
    by_tool = float(rivals.pop())
    drift = rigid_motions(situation.point) * rows.progress
    slow = np.einsum("ijn,kjn->kin", situation.whitener, drift)[:, :, fitted.accepted]
    rivals += [scan(fitted, slow).fall[0], weight_fall(fitted)]
    if best < max(max(rivals) + CLEAR, by_tool - CLEAR):
        return None
    before, row = _edge(fitted, int(kept[at - 1]), int(kept[at]))
    moment = 0.5 * (rows.moment[before] + rows.moment[row])
    return FrameStep(
        row, np.concatenate([base.sizes[at], [moment, 1.0]]), best, best < by_tool + CLEAR
    )


def _edge(fitted: Fit, before: int, row: int) -> tuple[int, int]:
    """Last reading before a step and first one after it; excluded ones between go to their side."""
    whole = with_the_excluded(fitted) if row > before + 1 else fitted
    kept = np.flatnonzero(whole.accepted)
    between = np.flatnonzero((kept > before) & (kept <= row))
    if between.size < 2:
        return before, row
    tried = scan(whole, whitened(whole, rigid_motions(whole.linear.situation.base_point)))
    at = int(between[np.argmax(tried.fall[between])])
    return int(kept[at - 1]), int(kept[at])


def step_remark(fitted: Fit, found: FrameStep) -> Remark:
    """What is said of a step of the frame."""
    rows = fitted.model.rows
    middle = fitted.linear.situation.base_point.mean(axis=1)[:, None]
    moved = np.tensordot(found.values[:6], rigid_motions(middle), axes=1)
    size = float(np.linalg.norm(moved))
    moved_by = (
        "The tracker, the base or all nests on the platform were moved"
        if found.or_tool
        else "The tracker or the base was moved"
    )
    return Remark(
        "station-moved",
        f"{moved_by} during the run: by {length(size)} before line "
        f"{rows.line[found.row]} ({rows.time_s[found.row]:.0f} s)",
        ranges(rows.line[found.row :], rows.line),
        f"One step of the frame explains "
        f"{100 * found.fall / max(excess(fitted), found.fall):.0f} % of the misfit",
        "The step is in the model as frame-shift; nothing is excluded for it",
        "Nothing, or begin a new run after the move; fasten what was moved",
        True,
        rows.runs[0].source,
    )
