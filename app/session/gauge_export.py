"""Rows of a journal with a gauge's numbers, as a run of version 2 has them."""

from collections.abc import Sequence

import numpy as np

from app.session.gauge_rows import GAUGE
from app.session.rows import Row
from calib.arrays import Array
from calib.runs.sensing import DISTANCE, KINDS, Sensing, Setup


def sensed_rows(rows: Sequence[Row], setup: Setup | None) -> tuple[Sensing, Array, Array]:
    """What N rows measure, their values (3, N) and covariances (3, 3, N), mm or rad."""
    count = len(rows)
    held = [row.raw.get(GAUGE) if row.kind == "reading" else None for row in rows]
    ((name, instrument),) = (setup or Setup()).instruments.items()
    value, covariance = np.full((3, count), np.nan), np.full((3, 3, count), np.nan)
    kind, seen = np.full(count, -1, dtype=np.intp), np.zeros((3, count), dtype=bool)
    ends, axis = np.full((2, count), -1, dtype=np.intp), np.zeros((3, count))
    for k, one in enumerate(held):
        if one is None:
            continue
        kind[k], seen[0, k] = KINDS.index(one["kind"]), True
        value[:, k], covariance[:, :, k] = 0.0, 0.0
        value[0, k], covariance[0, 0, k] = one["value"], one["sigma"] ** 2
        if instrument.axis is not None and kind[k] != DISTANCE:
            axis[:, k] = instrument.axis
        if one["pose2"]:
            ends[:, k] = [_stood(rows, k, label) for label in (rows[k].pose, one["pose2"])]
    sensing = Sensing(
        kind=kind,
        instrument=tuple(name if one else "" for one in held),
        second=tuple(one["nest2"] if one else "" for one in held),
        plane=tuple(one["plane"] if one else "" for one in held),
        ends=ends,
        seen=seen,
        axis=axis,
        attitude=np.repeat(np.eye(3)[:, :, None], count, axis=2),
        spread=np.zeros((6, 6, count)),
    )
    return sensing, value, covariance


def _stood(rows: Sequence[Row], before: int, label: str) -> int:
    """The last row before one at which the platform stood at a pose."""
    return max(
        k for k in range(before)
        if rows[k].pose == label and not rows[k].raw.get(GAUGE, {}).get("pose2")
    )  # fmt: skip
