"""A run that grows by hand: ``run.toml`` once, and a line of ``points.csv`` for every number.

Each line is on the disk before the next number is asked for; what has been written is a run of
version 2 at any moment, and one that is taken up again goes on behind its last line.
"""

import csv
import io
import os
from collections.abc import Mapping, Sequence
from pathlib import Path

import tomli_w

from app.files.machines import load_machine
from app.files.runs import HEADER, POINTS, read_run
from app.files.text import read_text
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.runs import parse_header

_BEFORE = ("time_s", "pose", "kind", "instrument", "nest", "nest2", "pose2")
TOOL = "tool"
"""Nest of the tip that touches."""
_BEHIND = ("z", "sz", "value", "sigma")


class TypedRun:
    """The files of a run that is being typed.

    Parameters
    ----------
    folder : Path
        With a ``run.toml`` of version 2, or one that :func:`begin` has made.
    """

    def __init__(self, folder: Path) -> None:
        self.folder, self._file = folder, folder / POINTS
        self.header = parse_header(read_text(folder / HEADER), source=str(folder / HEADER))
        self.machine = load_machine(self.header.machine, folder)
        self.columns = _columns(len(self.machine.actuators))
        table = csv.DictReader(read_text(self._file).splitlines())
        if tuple(table.fieldnames or ()) != self.columns or TOOL not in self.header.platform_nests:
            raise BadInput(
                "this run was not typed in",
                place=str(self._file),
                remedy="Name another folder, or one that this verb began",
            )
        self.rows = list(table)
        if any(row["nest"] for row in self.rows):
            read_run(folder)  # every line is checked, as by whoever fits it
        self._ends = [self._file.stat().st_size]

    @property
    def last_s(self) -> float:
        """Time of the last row, s."""
        return float(self.rows[-1]["time_s"]) if self.rows else 0.0

    @property
    def done(self) -> set[str]:
        """Poses at which a number was typed, and pairs ``A:B``, as the file was found."""
        read = [row for row in self.rows if row["nest"]]
        return {f"{r['pose']}:{r['pose2']}" if r["pose2"] else r["pose"] for r in read}

    @property
    def stood(self) -> set[str]:
        """Poses at which the machine has stood, as the file was found."""
        return {row["pose"] for row in self.rows}

    def write(self, cells: Mapping[str, object]) -> None:
        """Write one line; what it does not name is empty."""
        text = io.StringIO()
        row = [cells.get(name, "") for name in self.columns]
        csv.writer(text, lineterminator="\n").writerow(row)
        with self._file.open("a", encoding="utf-8", newline="") as file:
            file.write(text.getvalue())
            file.flush()
            os.fsync(file.fileno())
        self._ends.append(self._file.stat().st_size)

    def take_back(self) -> None:
        """Take the last line off again."""
        self._ends.pop()
        with self._file.open("r+b") as file:
            file.truncate(self._ends[-1])

    def readings(self) -> int:
        """Readings that the file holds now, every line checked."""
        rows = csv.DictReader(read_text(self._file).splitlines())
        return read_run(self.folder).run.readings if any(row["nest"] for row in rows) else 0


def _columns(actuators: int) -> tuple[str, ...]:
    return (*_BEFORE, *(f"q{k + 1}" for k in range(actuators)), *_BEHIND)


def begin(
    folder: Path,
    name: str,
    machine: Machine,
    instruments: Mapping[str, Mapping[str, object]],
    at: Sequence[float],
) -> None:
    """Write ``run.toml`` with instruments and the tool, and ``points.csv`` with a first row.

    Parameters
    ----------
    name : str
        Of the machine: shipped, or the path of its file.
    machine : Machine
        Begins at home.
    instruments : mapping
        Table of each by its name.
    at : (3,)
        Tip of the tool in the platform frame, mm.
    """
    file = Path(name)
    header = {
        "format": "pkm-run/2",
        "machine": str(file.resolve()) if file.suffix == ".toml" else name,
        "title": "typed in by hand",
        "nests": {"platform": {TOOL: list(at)}, "base": {}},
        "instruments": {one: dict(table) for one, table in instruments.items()},
    }
    folder.mkdir(parents=True, exist_ok=True)
    (folder / HEADER).write_text(tomli_w.dumps(header), encoding="utf-8")
    columns = _columns(len(machine.actuators))
    home = {"time_s": "0.0", "pose": "home"}
    home |= {f"q{k + 1}": f"{value:.6f}" for k, value in enumerate(machine.home_q)}
    rows = (columns, tuple(home.get(name, "") for name in columns))
    text = "".join(",".join(row) + "\n" for row in rows)
    (folder / POINTS).write_text(text, encoding="utf-8")
