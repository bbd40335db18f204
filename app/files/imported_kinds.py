"""Rows of several kinds of readings, as a run of version 2 has them: its two texts."""

import csv
import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import tomli_w

from app.files.import_commands import Row
from calib.arrays import Array
from calib.runs.header import OF_KINDS

KEYS = ("title", "tracker", "nests", "controller", "load", "instruments", "planes")
"""Tables of run.toml that a header hands on as they stand."""
ENDS = ("nest2", "plane")
"""What readings of one number may refer to."""
_PAIRS = {"sxy": (0, 1), "sxz": (0, 2), "syz": (1, 2)}


def header_text(machine: str, said: Mapping[str, Any]) -> str:
    """``run.toml`` of version 2 from the tables of a header, as TOML has them."""
    kept = {key: said[key] for key in KEYS if key in said}
    return tomli_w.dumps({"format": OF_KINDS, "machine": machine, **kept})


def points_text(rows: Sequence[Row], time_s: Array, channels: Sequence[str]) -> str:
    """``points.csv`` of version 2; fields that a row's kind does not have are empty."""
    cells = [_cells(row) for row in rows]
    names = list(dict.fromkeys(name for one in cells for name in one))
    count = rows[0].q.size
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    ends = [name for name in ENDS if any(getattr(row, name) for row in rows)]
    fixed = ["time_s", "pose", "kind", "instrument", "nest", *ends]
    writer.writerow([*fixed, *(f"q{k + 1}" for k in range(count)), *names, *channels])
    for row, own, time in zip(rows, cells, time_s.tolist(), strict=True):
        kind = row.kind if row.nest else ""
        instrument = row.instrument if row.nest else ""
        writer.writerow(
            [
                *(repr(time), row.pose, kind, instrument, row.nest),
                *(getattr(row, name) if row.nest else "" for name in ends),
                *(repr(value) for value in np.round(row.q, 12).tolist()),
                *(repr(own[name]) if name in own else "" for name in names),
                *(_channel(row.channels[name]) for name in channels),
            ]
        )
    return text.getvalue()


def _cells(row: Row) -> Mapping[str, float]:
    """What a reading holds, by the columns of its kind."""
    if row.cells is not None or row.position is None or row.covariance is None:
        return row.cells or {}
    held = {name: float(value) for name, value in zip("xyz", row.position, strict=True)}
    sigmas = np.sqrt(np.diag(row.covariance))
    held |= {f"s{name}": float(value) for name, value in zip("xyz", sigmas, strict=True)}
    for name, (a, b) in _PAIRS.items():
        if row.covariance[a, b] != 0.0:
            held[name] = float(row.covariance[a, b])
    return held


def _channel(value: float) -> str:
    return repr(value) if np.isfinite(value) else ""
