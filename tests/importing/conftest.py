"""A small clean run of the tripod, and its rows as other programs would have written them."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from app.files.runs import LoadedRun, read_run
from app.jobs.simulating import simulate
from calib.runs.record import Run

PLAN = """
format = "pkm-import/1"
[file]
delimiter = "{delimiter}"
decimal = "{decimal}"
[time]
column = "time"
[pose]
column = "pose"
[nest]
column = "nest"
[actuators]
columns = "q*"
[[reading]]
columns = ["x", "y", "z"]
[sigma]
value = "5 um"
"""


@dataclass(frozen=True)
class Bench:
    """A run, its header file, and a writer of tables."""

    folder: Path
    loaded: LoadedRun

    @property
    def run(self) -> Run:
        return self.loaded.run

    @property
    def header(self) -> Path:
        return self.loaded.folder / "run.toml"

    def table(
        self,
        path: Path,
        run: Run | None = None,
        *,
        units: str = "time[s],q[mm],x[mm]",
        cell: Callable[[float], str] = repr,
        delimiter: str = ",",
    ) -> Path:
        """Write rows of a run with units in the header."""
        run = run or self.run
        unit = dict(one.rstrip("]").split("[") for one in units.split(","))
        n = run.q.shape[0]
        names = [f"time[{unit['time']}]", "pose", "nest"]
        names += [f"q{k + 1}[{unit['q']}]" for k in range(n)]
        names += [f"{axis}[{unit['x']}]" for axis in "xyz"]
        rows = [delimiter.join(names)]
        for k in np.flatnonzero(run.measured):
            numbers = [*run.q[:, k], *run.position[:, k]]
            cells = [
                cell(float(run.time_s[k])),
                run.pose[k],
                run.nest[k],
                *map(cell, map(float, numbers)),
            ]
            rows.append(delimiter.join(cells))
        path.write_text("\n".join(rows) + "\n", encoding="utf-8")
        return path

    def plan(self, path: Path, *, delimiter: str = ",", decimal: str = ".", more: str = "") -> Path:
        """Write a map of such a table."""
        path.write_text(PLAN.format(delimiter=delimiter, decimal=decimal) + more, encoding="utf-8")
        return path


@pytest.fixture(scope="session")
def bench(tmp_path_factory: pytest.TempPathFactory) -> Bench:
    folder = tmp_path_factory.mktemp("tripod")
    simulate("tripod", folder / "run", poses=10, seed=3, noise_um=5.0, rise=0.0)
    return Bench(folder, read_run(folder / "run"))


def same(a: Run, b: Run, *, tolerance: float = 1e-8) -> bool:
    """Whether two runs hold the same readings; reference readings have no command of their own."""
    here = a.measured
    posed = np.array([bool(pose) for pose in a.pose])[here]
    return (
        np.allclose(a.position[:, here], b.position[:, b.measured], atol=tolerance)
        and np.allclose(a.q[:, here][:, posed], b.q[:, b.measured][:, posed], atol=tolerance)
        and tuple(np.array(a.nest)[here]) == tuple(np.array(b.nest)[b.measured])
    )
