"""Files that were joined: another session, another machine."""

from dataclasses import replace

import numpy as np

from bench.mistakes.clean import clean_run, in_order
from bench.mistakes.mistake import Chance
from calib.frames import Frame
from calib.runs.record import Run


def two_files(run: Run, chance: Chance) -> Run:
    """A second session was appended: every third row once more, the tracker elsewhere."""
    again = in_order(run, list(range(0, run.line.size, 3)))
    frame = Frame.of([*(chance.normal(size=3) * 400.0), 0.02, -0.01, 0.4])
    noise = 0.005 * chance.normal(size=again.position.shape)
    labels = tuple(f"{label}b" if label else label for label in again.pose)
    return _appended(run, replace(again, position=frame.apply(again.position) + noise, pose=labels))


def two_machines(run: Run, chance: Chance) -> Run:
    """A file of the sister machine was appended, as if of this one."""
    return _appended(run, clean_run(run.header.machine, 92, poses=24))


def _appended(run: Run, other: Run) -> Run:
    end = float(run.time_s[-1]) + 600.0
    names = [name for name in run.channels if name in other.channels]
    return replace(
        run,
        line=np.arange(2, 2 + run.line.size + other.line.size),
        time_s=np.concatenate([run.time_s, end + other.time_s]),
        q=np.concatenate([run.q, other.q], axis=1),
        measured=np.concatenate([run.measured, other.measured]),
        position=np.concatenate([run.position, other.position], axis=1),
        covariance=np.concatenate([run.covariance, other.covariance], axis=2),
        pose=run.pose + other.pose,
        nest=run.nest + other.nest,
        channels={n: np.concatenate([run.channels[n], other.channels[n]]) for n in names},
    )
