"""Rows of commands that nobody has read yet, for what effects ask of readings."""

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from calib.arrays import Array, IntArray
from calib.effects.component import Effect
from calib.mechanism.description import Machine
from calib.runs.commanded import CommandedPath
from calib.runs.header import Header, Load
from calib.runs.record import Run
from calib.runs.stack import STATES, Rows


def rows_at(
    machine: Machine,
    run: Run,
    path: CommandedPath,
    at: IntArray,
    channels: Mapping[str, Array],
    reference: Array | None = None,
) -> Rows:
    """Rows that stand at places (N,) of a path, read without noise at the platform's origin.

    ``run`` says what the machine carries: :func:`empty_run`.

    ``reference`` (n, 1) is what the coordinates refer to; that of the drawing if not given.
    """
    extension = path.extension[:, at]
    return Rows(
        machine=machine,
        runs=(run,),
        extension=extension,
        q=machine.coordinates(extension) if reference is None else extension + reference,
        path=path,
        at=at,
        time_s=path.time_s[at],
        channels=dict(channels),
        **_blank(at.size),
    )


@lru_cache(maxsize=16)
def _blank(count: int) -> dict[str, Any]:
    """What all rows of commands have in common, ``count`` of them; not to be written to."""
    blank: dict[str, Any] = {
        "run": np.zeros(count, dtype=np.intp),
        "line": np.arange(1, count + 1, dtype=np.intp),
        "progress": np.zeros(count),
        "position": np.zeros((3, count)),
        "covariance": np.repeat(np.eye(3)[:, :, None], count, axis=2),
        "nest": np.zeros((3, count)),
        "on_platform": np.ones(count, dtype=bool),
        "fold": np.full(count, -1, dtype=np.intp),
    }
    for values in blank.values():
        values.setflags(write=False)
    names = tuple(str(k + 1) for k in range(count))
    return {**blank, "pose_name": names, "nest_name": ("",) * count}


def rows_with_everything(effect: Effect, machine: Machine, load: Load | None) -> Rows:
    """Two rows that have every channel, for the names of an effect's unknowns."""
    names = [c for c in (*effect.channels, *effect.depends) if c not in STATES]
    channels = {c: (20.0 if c.endswith("_C") else 1.0) + np.arange(2.0) for c in names}
    home = machine.extension(np.stack([machine.home_q, machine.home_q + 1e-3], axis=1))
    motion = np.array([axis.motion for axis in machine.axes])
    path = CommandedPath.of_run(home, np.arange(2.0), motion)
    return rows_at(machine, empty_run(load), path, np.arange(2, dtype=np.intp), channels)


def empty_run(load: Load | None) -> Run:
    """A run without a row: effects ask it for the load."""
    return Run(
        header=Header(machine="", load=load),
        source="command",
        line=np.zeros(0, dtype=np.int64),
        time_s=np.zeros(0),
        pose=(),
        nest=(),
        q=np.zeros((0, 0)),
        measured=np.zeros(0, dtype=bool),
        position=np.zeros((3, 0)),
        covariance=np.zeros((3, 3, 0)),
        channels={},
        left_aside={},
    )
