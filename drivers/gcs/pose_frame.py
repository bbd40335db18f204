"""What the poses of a closed controller refer to: blocking calls for the worker thread.

Its active coordinate systems (``KEN?`` answers ``NAME=TYPE``), its pivot (``SPI? R S T``) and the
units of its axes (``PUN?``, where it offers that).
"""

from collections.abc import Sequence
from dataclasses import dataclass

from drivers.errors import ProtocolError, Refused
from drivers.gcs.answers import by_item, numbers
from drivers.gcs.conventions import Vector
from drivers.gcs.errors import UNKNOWN_COMMAND
from drivers.gcs.line import Line

ROOT = "ZERO"
PIVOT_AXES = ("R", "S", "T")
SAME_PIVOT_MM = 1e-6


@dataclass(frozen=True)
class PoseFrame:
    """Names of the active coordinate systems besides the root, in order; the pivot in mm."""

    systems: tuple[str, ...]
    pivot: Vector

    @property
    def system(self) -> str:
        """The active coordinate systems in words."""
        return " ".join(self.systems) or ROOT

    def against(self, wanted: "PoseFrame") -> str:
        """What is otherwise than wanted, in words; empty if nothing."""
        found = []
        if self.systems != wanted.systems:
            found.append(f"its coordinate system is {self.system}, {wanted.system} is wanted")
        apart = max(abs(a - b) for a, b in zip(self.pivot, wanted.pivot, strict=True))
        if apart > SAME_PIVOT_MM:
            found.append(f"its pivot is {said(self.pivot)} mm, {said(wanted.pivot)} mm is wanted")
        return "; ".join(found)


def said(values: Sequence[float]) -> str:
    """Numbers with blanks between, as a site file has them."""
    return " ".join(f"{value:.10g}" for value in values)


def chosen(systems: Sequence[str]) -> tuple[str, ...]:
    """The systems without the root, in order."""
    return tuple(sorted(name for name in systems if name != ROOT))


def read_frame(line: Line) -> PoseFrame:
    """Ask for both; raises Refused, ProtocolError, Silence."""
    enabled = by_item(line.query("KEN?"), line.device)
    pivot = numbers(line.query(f"SPI? {' '.join(PIVOT_AXES)}"), PIVOT_AXES, line.device)
    return PoseFrame(chosen(list(enabled)), (pivot[0], pivot[1], pivot[2]))


def set_frame(line: Line, wanted: PoseFrame) -> None:
    """Activate the systems and set the pivot; raises Refused, which names the command."""
    line.command(f"KEN {ROOT}")
    for name in wanted.systems:
        line.command(f"KEN {name}")
    pairs = zip(PIVOT_AXES, wanted.pivot, strict=True)
    line.command("SPI " + " ".join(f"{axis} {value!r}" for axis, value in pairs))


def need_frame(line: Line, wanted: PoseFrame) -> None:
    """Refuse a controller whose poses now refer to something else."""
    complaint = read_frame(line).against(wanted)
    if complaint:
        raise Refused(
            f"its poses do not mean what the site file says: {complaint}",
            device=line.device,
            remedy=f"Set it at the controller (KEN, SPI) or by set_frame = true, or write system "
            f"and pivot into the site file as they were when the model was measured; "
            f'this one says system = "{wanted.system}"',
        )


def need_unit(line: Line, axes: Sequence[str], degrees: bool) -> None:
    """Refuse a controller that says that its angles have another unit than the site file says."""
    try:
        units = by_item(line.query(f"PUN? {' '.join(axes)}"), line.device)
    except Refused as error:
        if error.code == UNKNOWN_COMMAND:
            return
        raise
    wanted = ["MM"] * 3 + ["DEG" if degrees else "RAD"] * 3
    for axis, unit in zip(axes, wanted, strict=True):
        if axis not in units:
            raise ProtocolError(
                f"tells no unit of axis {axis}",
                device=line.device,
                remedy="Check pose_axes in the site file against the axes that it has.",
            )
        if units[axis].upper() != unit:
            raise Refused(
                f"counts axis {axis} in {units[axis]}, the site file in {unit.lower()}",
                device=line.device,
                remedy="Correct angle_unit or axes in the site file, or the unit at the controller",
            )
