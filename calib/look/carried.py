"""How far a tracker was carried, where a step of the frame was fitted."""

from dataclasses import replace

import numpy as np

from calib import digits
from calib.identify.fitting import Fit
from calib.mechanism.rigid import exponential
from calib.runs.remark import Remark


def as_fitted(remark: Remark, fitted: Fit) -> Remark:
    """A remark on a station that moved, with what the tracker did if it was the tracker.

    A point p of the base goes from R p + t to R (exp([w]) p + v) + t in the tracker frame: the
    tracker turned by w, and its origin went |t + R v - R exp([w]) R^T t|.
    """
    model = fitted.model
    if remark.name != "station-moved" or "frame-shift" not in model.rows.known:
        return remark
    at = model.free.size
    for effect, group in zip(model.effects, model.unknowns, strict=True):
        if effect.id == "frame-shift":
            break
        at += len(group)
    else:
        return remark
    shift, turn, where = fitted.values[at : at + 3], fitted.values[at + 3 : at + 6], at + 7
    if fitted.values[where] < 0.5:
        return remark
    state = fitted.linear.state
    rotation, position = state.frame_rotation[:, :, 0], state.frame_position[:, 0]
    turned = rotation @ exponential(turn) @ rotation.T
    went = float(np.linalg.norm(position + rotation @ shift - turned @ position))
    by = f"{digits.length(went)} and turned by {digits.turn(float(np.linalg.norm(turn)))}"
    return replace(remark, says=f"{remark.says}. If it was the tracker, it went {by}")
