"""A run as the two texts that ``run.toml`` and ``points.csv`` hold: the only writer of the format.

Described in docs/run-format.md.
"""

import csv
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import tomli_w
from numpy.typing import NDArray

from calib.runs.header import FORMAT, Header
from calib.runs.points import COVARIANCES, POSITION, SIGMAS
from calib.runs.record import Run
from calib.runs.writing_kinds import points_text, setup_table

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Digits:
    """How the numbers of each kind of column are written, as Python's format specifications.

    ``""`` writes as many digits as it takes to read the same number back, bit for bit.
    ``channels`` is by the channel's name, ``channel`` for those that are not in it.
    """

    time: str = ""
    q: str = ""
    position: str = ""
    sigma: str = ""
    covariance: str = ""
    channel: str = ""
    channels: Mapping[str, str] = field(default_factory=dict)


EXACT = Digits()


def format_run(run: Run, digits: Digits = EXACT) -> tuple[str, str]:
    """Write a run.

    Returns
    -------
    run_text, points_text : str
        Texts that :func:`calib.runs.parse_run` reads back to the same numbers. Columns that were
        left aside because they hold text are not among them.
    """
    return format_header(run.header), format_points(run, digits)


def format_header(header: Header) -> str:
    """The text of ``run.toml``."""
    table: dict[str, Any] = {"format": FORMAT, "machine": header.machine, "title": header.title}
    if header.tracker:
        table["tracker"] = dict(header.tracker)
    table["nests"] = {
        "platform": {name: p.tolist() for name, p in header.platform_nests.items()},
        "base": {name: p.tolist() for name, p in header.base_nests.items()},
    }
    held: dict[str, Mapping[str, Any]] = {
        "parameters": header.controller_parameters,
        "compensation": header.compensation,
        "frame": header.controller_frame,
    }
    serial = {"serial": header.controller_serial} if header.controller_serial else {}
    if serial or any(held.values()):
        table["controller"] = serial | {n: dict(values) for n, values in held.items() if values}
    if header.load is not None:
        table["load"] = {
            "gravity": header.load.gravity.tolist(),
            "platform_mass_kg": header.load.platform_mass_kg,
            "platform_com": header.load.platform_com.tolist(),
            "payload_com": header.load.payload_com.tolist(),
        }
    if header.setup is not None:
        return setup_table(header.setup, table)
    return tomli_w.dumps(table)


def format_points(run: Run, digits: Digits = EXACT) -> str:
    """The text of ``points.csv``; covariances are written where any is not zero.

    Runs of version 2 are written to the last bit, whatever ``digits`` say.
    """
    if run.sensing is not None:
        return points_text(run, run.sensing)
    names, columns = _columns(run, digits)
    target = _Lines()
    writer = csv.writer(target, lineterminator="\n")
    writer.writerow(["time_s", "pose", "nest", *names])
    time = _cells(run.time_s, digits.time)
    writer.writerows(zip(time, run.pose, run.nest, *columns, strict=True))
    return "".join(target.lines)


def _columns(run: Run, digits: Digits) -> tuple[list[str], list[list[str]]]:
    """Names and cells of the columns behind time, pose and nest."""
    names = [f"q{number}" for number in range(1, run.q.shape[0] + 1)]
    columns = [_cells(column, digits.q) for column in run.q]
    names += POSITION
    columns += [_cells(column, digits.position) for column in run.position]
    names += SIGMAS
    variances = np.einsum("iin->in", run.covariance)
    columns += [_cells(column, digits.sigma) for column in np.sqrt(variances)]
    off_diagonal = run.covariance[[0, 0, 1], [1, 2, 2]]
    if bool(np.any(np.nan_to_num(off_diagonal) != 0.0)):
        names += COVARIANCES
        columns += [_cells(column, digits.covariance) for column in off_diagonal]
    for name, values in run.channels.items():
        names.append(name)
        columns.append(_cells(values, digits.channels.get(name, digits.channel)))
    return names, columns


def _cells(column: Array, digits: str) -> list[str]:
    finite = np.isfinite(column).tolist()
    return [
        format(value, digits) if good else ""
        for value, good in zip(column.tolist(), finite, strict=True)
    ]


class _Lines:
    """Where the writer's lines are kept: calib touches no files."""

    def __init__(self) -> None:
        self.lines: list[str] = []

    def write(self, line: str) -> None:
        self.lines.append(line)
