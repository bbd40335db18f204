"""Runs of version 2 as text: what :mod:`calib.runs.kinds_table` reads back."""

import csv
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray

from calib.mechanism.rigid import to_euler
from calib.runs.header import OF_KINDS
from calib.runs.kinds_table import (
    AXIS,
    CIRCLE_SIGMAS,
    CIRCLES,
    EULER,
    POSE_COVARIANCES,
    TURNS,
)
from calib.runs.points import COVARIANCES, POSITION, SIGMAS
from calib.runs.record import Run
from calib.runs.sensing import ANGLES, KINDS, POINT, POSE, Sensing, Setup

Array = NDArray[np.float64]
LABELS = ("time_s", "pose", "kind", "instrument", "nest", "nest2", "plane", "pose2")


def setup_table(setup: Setup, table: dict[str, Any]) -> str:
    """``run.toml`` from the ``table`` of version 1, with what version 2 says more."""
    table["format"] = OF_KINDS
    for body in table["nests"].values():
        for name in body:
            if name in setup.nests:
                six = setup.nests[name][[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
                body[name] = {"at": body[name], "covariance": six.tolist()}
    if setup.instruments:
        table["instruments"] = {
            name: {
                "frame": one.frame,
                **({"near": one.near.tolist()} if one.near is not None else {}),
                **({"axis": one.axis.tolist()} if one.axis is not None else {}),
                **({"zero_sigma": one.zero_sigma} if one.zero_sigma is not None else {}),
                **({"scale_sigma": one.scale_sigma} if one.scale_sigma is not None else {}),
                **({"model": one.model} if one.model else {}),
            }
            for name, one in setup.instruments.items()
        }
    if setup.planes:
        table["planes"] = {
            name: {
                "normal": one.normal.tolist(), "through": one.through.tolist(),
                "sigma": one.sigma, "tilt_sigma": one.tilt_sigma,
            }
            for name, one in setup.planes.items()
        }  # fmt: skip
    return tomli_w.dumps(table)


def points_text(run: Run, sensing: Sensing) -> str:
    """``points.csv``: columns that no row fills are left out; numbers read back bit for bit."""
    rows = [_row(run, sensing, row) for row in range(run.time_s.size)]
    q = [f"q{k + 1}" for k in range(run.q.shape[0])]
    filled = dict.fromkeys(name for row in rows for name in row)
    known = [*LABELS, *q, *run.channels]
    names = [*LABELS, *q, *(n for n in filled if n not in known), *run.channels]
    lines = _Lines()
    writer = csv.DictWriter(lines, names, restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return "".join(lines.text)


def _row(run: Run, sensing: Sensing, row: int) -> dict[str, Any]:
    cells: dict[str, Any] = {
        "time_s": run.time_s[row], "pose": run.pose[row], "instrument": sensing.instrument[row],
        "nest": run.nest[row], "nest2": sensing.second[row], "plane": sensing.plane[row],
    }  # fmt: skip
    cells |= {f"q{k + 1}": value for k, value in enumerate(run.q[:, row])}
    cells |= {name: v[row] for name, v in run.channels.items() if np.isfinite(v[row])}
    kind = int(sensing.kind[row])
    if kind >= 0:
        cells |= {"kind": KINDS[kind], **_reading(run, sensing, row, kind)}
        if sensing.ends[1, row] >= 0:
            cells["pose2"] = run.pose[sensing.ends[1, row]]
    return {
        name: value if isinstance(value, str) else float(value) for name, value in cells.items()
    }


def _reading(run: Run, sensing: Sensing, row: int, kind: int) -> dict[str, float]:
    value, covariance = run.position[:, row], run.covariance[:, :, row]
    if kind == POSE:
        spread = sensing.spread[:, :, row]
        sigma = np.sqrt(np.diag(spread))
        cells = dict(zip((*POSITION, *SIGMAS, *TURNS), [*value, *sigma], strict=True))
        cells |= dict(zip(EULER, to_euler(sensing.attitude[:, :, row]), strict=True))
        return cells | {n: spread[i, j] for n, (i, j) in POSE_COVARIANCES.items() if spread[i, j]}
    if kind in (POINT, ANGLES):
        names = (POSITION, SIGMAS) if kind == POINT else (CIRCLES, CIRCLE_SIGMAS)
        cells = {}
        for axis, (name, sigma_name) in enumerate(zip(*names, strict=True)):
            if sensing.seen[axis, row]:
                cells |= {name: value[axis], sigma_name: np.sqrt(covariance[axis, axis])}
        pairs = {n: POSE_COVARIANCES[n] for n in COVARIANCES} if kind == POINT else {}
        return cells | {n: covariance[i, j] for n, (i, j) in pairs.items() if covariance[i, j]}
    cells = {"value": value[0], "sigma": np.sqrt(covariance[0, 0])}
    if np.any(sensing.axis[:, row]):
        cells |= dict(zip(AXIS, sensing.axis[:, row], strict=True))
    return cells


class _Lines:
    """Where the writer's lines are kept."""

    def __init__(self) -> None:
        self.text: list[str] = []

    def write(self, line: str) -> None:
        self.text.append(line)
