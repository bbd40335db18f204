"""A run as the two texts that ``run.toml`` and ``points.csv`` hold."""

import csv
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray

from calib.runs.header import FORMAT, Header
from calib.runs.points import COVARIANCES, POSITION, SIGMAS
from calib.runs.record import Run

Array = NDArray[np.float64]


def format_run(run: Run) -> tuple[str, str]:
    """Write a run.

    Returns
    -------
    run_text, points_text : str
        Texts that :func:`calib.runs.parse_run` reads back to the same numbers, bit for bit.
    """
    return tomli_w.dumps(_header_table(run.header)), _points_text(run)


def _header_table(header: Header) -> dict[str, Any]:
    table: dict[str, Any] = {"format": FORMAT, "machine": header.machine, "title": header.title}
    if header.tracker:
        table["tracker"] = dict(header.tracker)
    table["nests"] = {
        "platform": {name: p.tolist() for name, p in header.platform_nests.items()},
        "base": {name: p.tolist() for name, p in header.base_nests.items()},
    }
    held = {"parameters": header.controller_parameters, "compensation": header.compensation}
    if any(held.values()):
        table["controller"] = {name: dict(values) for name, values in held.items() if values}
    if header.load is not None:
        table["load"] = {
            "gravity": header.load.gravity.tolist(),
            "platform_mass_kg": header.load.platform_mass_kg,
            "platform_com": header.load.platform_com.tolist(),
            "payload_com": header.load.payload_com.tolist(),
        }
    return table


class _Lines:
    """Where the writer's lines are kept: calib touches no files."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def write(self, line: str) -> None:
        self.lines.append(line)


def _cell(value: float) -> str:
    return "" if np.isnan(value) else repr(float(value))


def _points_text(run: Run) -> str:
    off_diagonal = run.covariance[[0, 0, 1], [1, 2, 2]]
    with_covariance = bool(np.any(np.nan_to_num(off_diagonal) != 0.0))
    actuators = [f"q{number}" for number in range(1, run.q.shape[0] + 1)]
    names = ["time_s", "pose", "nest", *actuators, *POSITION, *SIGMAS]
    columns: list[Array] = [*run.q, *run.position, *np.sqrt(np.einsum("iin->in", run.covariance))]
    if with_covariance:
        names += COVARIANCES
        columns += list(off_diagonal)
    names += run.channels
    columns += list(run.channels.values())
    target = _Lines()
    writer = csv.writer(target, lineterminator="\n")
    writer.writerow(names)
    for row, (pose, nest) in enumerate(zip(run.pose, run.nest, strict=True)):
        cells = [_cell(column[row]) for column in columns]
        writer.writerow([_cell(run.time_s[row]), pose, nest, *cells])
    return "".join(target.lines)
