"""Readings typed in by hand: heights, a dial gauge, or calipers between marks, pose by pose."""

import math
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np

from app.defaults import UNITS
from app.doubt import doubt
from app.files.machines import load_machine
from app.files.poses import read_marks
from app.files.runs import HEADER
from app.files.typed_run import TOOL, TypedRun, begin
from app.files.wanted_poses import read_wanted
from app.jobs.record import Report
from calib.arrays import Array
from calib.errors import BadInput
from calib.mechanism.rigid import rotate
from calib.poses.reach import PoseSet, solve_poses

What = Literal["height", "gauge", "calipers"]
"""mm in one unit."""
LATER, BACK, STOP = "", "b", "s"
"""Answers that are no number: leave it for later, take the last one back, stop."""

INSTRUMENTS: dict[str, dict[str, object]] = {
    "height": {"frame": "base"},
    "gauge": {"frame": "base", "axis": [0.0, 0.0, 1.0], "zero_sigma": 1000.0},
    "calipers": {"frame": "base"},
}
"""What a run that is begun says of them."""
Ask = Callable[[str], str]


@dataclass(frozen=True, kw_only=True)
class EnteredReport(Report):
    """What was typed (``pkm-entered/1``); ``left`` are poses or pairs without a number."""

    FORMAT: ClassVar[str] = "pkm-entered/1"
    run: str
    machine: str
    readings: int
    typed: int
    left: tuple[str, ...]


@dataclass(frozen=True)
class Item:
    """One number to be asked for: ``label`` (``other`` the second mark), and what is expected."""

    label: str
    other: str
    pose: int
    expected: float

    @property
    def name(self) -> str:
        """How it is called."""
        return f"{self.label}:{self.other}" if self.other else self.label


def enter(
    run: Path,
    poses: Path,
    ask: Ask,
    tell: Callable[[str], None],
    *,
    what: What,
    sigma_mm: float,
    machine: str | None = None,
    unit: str = "mm",
    decimal: str = ".",
    pairs: Sequence[tuple[str, str]] = (),
    at: Sequence[float] = (0.0, 0.0, 0.0),
    near_mm: float = 2.0,
    clock: Callable[[], float] = time.monotonic,
) -> EnteredReport:
    """Ask for a number at every pose (or for every pair of marks) and write each into a run.

    A run that is there is gone on with: what it holds is not asked for again.

    Raises
    ------
    BadInput
        For poses out of reach, labels that are not among them, a run that was not typed.
    """
    if not (run / HEADER).exists():
        if machine is None:
            raise BadInput(
                "there is no run yet, and no machine is named",
                place=str(run),
                remedy="Say which: --machine delta, or a machine file",
            )
        begin(run, machine, load_machine(machine), INSTRUMENTS, at)
    typed = TypedRun(run)
    nest = typed.header.platform_nests[TOOL]
    wanted = read_wanted(poses, typed.machine)
    found = solve_poses(typed.machine, wanted.task)
    if what == "calipers" and not pairs and poses.suffix.lower() == ".toml":
        pairs = read_marks(poses, typed.machine)
    items = _items(wanted.names, found, nest, what, pairs)
    manner = _Manner(what, sigma_mm, unit, decimal, near_mm, clock)
    session = _Typing(typed, found, wanted.names, ask, tell, manner)
    count, left = session.go(items)
    return EnteredReport.of(
        {
            "format": EnteredReport.FORMAT, "run": str(run), "machine": typed.machine.name,
            "readings": typed.readings(), "typed": count, "left": left,
        }
    )  # fmt: skip


@dataclass(frozen=True)
class _Manner:
    """What is typed, and how."""

    what: What
    sigma_mm: float
    unit: str
    decimal: str
    near_mm: float
    clock: Callable[[], float]


def _items(
    names: Sequence[str], found: PoseSet, nest: Array, what: What, pairs: Sequence[tuple[str, str]]
) -> list[Item]:
    """What is to be asked, in order."""
    arm = rotate(found.poses.rotation, np.repeat(nest[:, None], len(names), axis=1))
    tips = found.poses.position + arm
    if what != "calipers":
        if pairs:
            raise BadInput("pairs are for calipers", remedy="Leave --pair out")
        return [Item(name, "", k, float(tips[2, k])) for k, name in enumerate(names)]
    if not pairs:
        raise BadInput(
            "which marks are measured between?", remedy="Name pairs of poses: --pair A:B --pair A:C"
        )
    place = {name: k for k, name in enumerate(names)}
    strange = [one for pair in pairs for one in pair if one not in place]
    if strange:
        raise BadInput(
            f'there is no pose "{strange[0]}"', place="--pair", remedy=f"Known: {', '.join(place)}"
        )
    return [
        Item(a, b, place[a], float(np.linalg.norm(tips[:, place[a]] - tips[:, place[b]])))
        for a, b in pairs
    ]


class _Typing:
    """One sitting: asks, doubts, writes."""

    def __init__(
        self, typed: TypedRun, found: PoseSet, names: Sequence[str], ask: Ask,
        tell: Callable[[str], None], manner: _Manner,
    ) -> None:  # fmt: skip
        self._typed, self._found, self._names = typed, found, names
        self._ask, self._tell, self._manner = ask, tell, manner
        self._before: list[tuple[float, float]] = []

    def go(self, items: Sequence[Item]) -> tuple[int, list[str]]:
        """Ask for all that is not there; answers how many were typed, and what is left by name."""
        begun, first = self._manner.clock(), self._typed.last_s
        done = self._typed.done
        waiting = [item for item in items if item.name not in done]
        if self._manner.what == "calipers" and waiting:
            self._marks(items)
        answered: list[Item] = []
        left: list[Item] = []
        while waiting:
            item = waiting[0]
            given = self._number(item, len(waiting))
            if given == STOP:
                break
            if given == BACK:
                if not answered:
                    self._tell("nothing was typed in this sitting")
                    continue
                self._typed.take_back()
                self._before.pop()
                waiting.insert(0, answered.pop())
                continue
            waiting.pop(0)
            if given == LATER:
                left.append(item)
                continue
            assert isinstance(given, float)
            self._write(item, given, first + self._manner.clock() - begun)
            self._before.append((given, item.expected))
            answered.append(item)
        return len(answered), [item.name for item in (*left, *waiting)]

    def _number(self, item: Item, left: int) -> float | str:
        """A number in mm, or one of the words."""
        where = self._where(item)
        while True:
            text = self._ask(
                f"{where} [{left} left] {self._manner.what}, {self._manner.unit}"
            ).strip()
            if text in (LATER, BACK, STOP):
                return text
            value = self._read(text)
            if value is None:
                self._tell(
                    f'"{text}" is no number: {self._manner.unit}, decimals behind '
                    f'"{self._manner.decimal}"; empty: later, {BACK}: take the last one back, '
                    f"{STOP}: stop"
                )
                continue
            if self._manner.what == "calipers" and value <= 0.0:
                self._tell("a distance is larger than zero")
                continue
            own = self._manner.what == "gauge"
            found = doubt(
                text, value, item.expected, self._before, self._manner.near_mm, own, self._read
            )
            if found is None:
                return value
            if (sure := self._sure(text, value, found.says, found.meant, found.how)) is not None:
                return sure

    def _sure(
        self, text: str, value: float, says: str, meant: float | None, how: str
    ) -> float | None:
        """Ask what was meant; None: type it anew."""
        self._tell(f"{text} {self._manner.unit}: {says}")
        offered = ""
        if meant is not None:
            offered = f"m: {meant / UNITS[self._manner.unit]:.6g} was meant ({how}), "
        answer = self._ask(f"{offered}k: keep it as it is, empty: type it anew").strip()
        if answer == "k":
            return value
        return meant if answer == "m" else None

    def _where(self, item: Item) -> str:
        if item.other:
            return f"marks {item.label} and {item.other}"
        actuators = self._found.machine.actuators
        shown = ", ".join(
            f"{one.name} = {value:.4f}"
            for one, value in zip(actuators, self._found.q[:, item.pose], strict=True)
        )
        return f"pose {item.label}: {shown};"

    def _read(self, text: str) -> float | None:
        """Number that was typed, mm; None if it is none."""
        other = "," if self._manner.decimal == "." else "."
        if other in text or "_" in text:
            return None
        try:
            value = float(text.replace(self._manner.decimal, "."))
        except ValueError:
            return None
        return UNITS[self._manner.unit] * value if math.isfinite(value) else None

    def _marks(self, items: Sequence[Item]) -> None:
        """Rows that say where the marks were left, those that are not there."""
        there = self._typed.stood
        for name in dict.fromkeys(one for item in items for one in (item.label, item.other)):
            if name not in there:
                self._typed.write(self._row(name, self._typed.last_s))

    def _row(self, label: str, seconds: float) -> dict[str, object]:
        q = self._found.q[:, self._names.index(label)]
        cells: dict[str, object] = {"time_s": f"{seconds:.1f}", "pose": label}
        return cells | {f"q{k + 1}": f"{value:.6f}" for k, value in enumerate(q)}

    def _write(self, item: Item, value: float, seconds: float) -> None:
        read: dict[str, object]
        kind = {"height": "point", "gauge": "direction", "calipers": "distance"}[self._manner.what]
        read = {"kind": kind, "instrument": self._manner.what, "nest": TOOL}
        if self._manner.what == "height":
            read |= {"z": f"{value:.6f}", "sz": f"{self._manner.sigma_mm:.6g}"}
        else:
            read |= {"value": f"{value:.6f}", "sigma": f"{self._manner.sigma_mm:.6g}"}
        if item.other:
            read["pose2"] = item.other
        self._typed.write(self._row(item.label, seconds) | read)
