"""Gravity that is stated in another direction than the one in which the weight acts.

Asked only where [load] states no vertical of the base: a machine that hangs on a wall is right to.
"""

from dataclasses import replace

import numpy as np

from calib.arrays import Array
from calib.effects import effect_named
from calib.identify.fitting import Fit
from calib.look.scan import scan
from calib.model.columns import whitened_columns
from calib.runs.remark import Remark

UPRIGHT = 0.985
"""Part of gravity along z of the base from which on it is vertical there (10 deg)."""
CLEAR = 30.0
"""Fall of the cost by which the vertical must be better than what is stated."""


def gravity_elsewhere(fitted: Fit) -> Remark | None:
    """Say if the readings show a weight along z of the base, and [load] states another direction.

    Whether it points up or down is told by the sign of a compliance.
    """
    rows = fitted.model.rows
    load = rows.runs[0].header.load
    if load is None or len(rows.runs) > 1:
        return None
    size = float(np.linalg.norm(load.gravity))
    if size == 0.0 or abs(load.gravity[2]) > UPRIGHT * size:
        return None
    if not _asked(fitted):
        return None
    stated, _ = _fall(fitted, load.gravity)
    upright, compliance = _fall(fitted, np.array([0.0, 0.0, -size]))
    clear = CLEAR * max(1.0, fitted.chi2_per_dof)
    if upright < stated + clear or np.any(compliance <= 0.0):
        return None
    told = ", ".join(f"{value:.4g}" for value in load.gravity)
    return Remark(
        "gravity-direction",
        f"The weight acts along -z of the base, [load] gravity states [{told}]",
        (),
        f"With gravity along -z legs or drives that yield lower the cost of the fit by "
        f"{upright:.3g}, as it is stated by {stated:.3g}",
        "Taken as it stands: what is found for the weight means nothing",
        "Write gravity in the base frame: [0.0, 0.0, -9.80665] where z of the base points up",
        False,
        rows.runs[0].source,
    )


def _asked(fitted: Fit) -> bool:
    """Whether a weight can show at all: a load is stated, and the payload of every reading."""
    rows = fitted.model.rows
    sag = effect_named("gravity-sag", rows.machine)
    payload = rows.channels.get("payload_kg", np.zeros(rows.count))
    known = bool(np.isfinite(payload).all())
    return known and not sag.lacking(rows.machine) and not sag.unavailable(rows)


def weight_fall(fitted: Fit) -> float:
    """Fall of the cost by a weight that acts as stated, or downwards; 0 where none can show.

    A payload that is put on at some moment moves what a step at that moment would move.
    """
    load = fitted.model.rows.runs[0].header.load
    if load is None or len(fitted.model.rows.runs) > 1 or not _asked(fitted):
        return 0.0
    down = np.array([0.0, 0.0, -float(np.linalg.norm(load.gravity))])
    return max(_fall(fitted, load.gravity)[0], _fall(fitted, down)[0])


def _fall(fitted: Fit, gravity: Array) -> tuple[float, Array]:
    """Fall of the cost by ``gravity-sag`` with gravity (3,), m/s^2, and its unknowns."""
    rows, situation = fitted.model.rows, fitted.linear.situation
    sag = effect_named("gravity-sag", rows.machine)
    header = rows.runs[0].header
    assert header.load is not None
    turned = replace(header, load=replace(header.load, gravity=gravity))
    there = replace(situation, rows=replace(rows, runs=(replace(rows.runs[0], header=turned),)))
    signature = sag.signature(there, np.zeros(len(sag.unknowns(rows))))
    tried = scan(fitted, whitened_columns(signature, there)[:, :, fitted.accepted])
    return float(tried.fall[0]), tried.sizes[0]
