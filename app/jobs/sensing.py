"""Which geometric errors matter: their effect on the pose, and tolerances for an accuracy."""

import math
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from app.files.machines import closed_machine
from app.jobs.chosen_runs import File
from app.jobs.drawing import DrawnEntry, Watch, drawn_errors
from app.jobs.record import Record, Report
from calib.analysis.coverage import workspace_poses
from calib.analysis.sensitivity import Index, Sensitivity, Tolerance, tolerances
from calib.analysis.sensitivity import sensitivity as global_sensitivity
from calib.errors import BadInput

DEGREE = math.radians(1.0)


@dataclass(frozen=True, kw_only=True)
class SensitivityEntry(Record):
    """An error, or all of a kind over the limbs: what it does to the pose over the workspace.

    ``position_mm`` and ``orientation_deg`` are means per ``per`` (mm or deg) of the error, with
    their spread; ``tolerance`` is that of the machine file, in ``per``, and the shares are what it
    causes (one standard deviation).
    """

    name: str
    per: str
    position_mm: float
    position_spread_mm: float
    orientation_deg: float
    orientation_spread_deg: float
    tolerance: float
    position_share_mm: float
    orientation_share_deg: float


@dataclass(frozen=True, kw_only=True)
class PoseSpread(Record):
    """RMS error of a machine within its tolerances."""

    position_rms_mm: float
    orientation_rms_deg: float


@dataclass(frozen=True, kw_only=True)
class ToleranceEntry(Record):
    """A tolerance (+- 3 sigma) for a wanted accuracy: of this kind alone, and shared by all."""

    kind: str
    unit: str
    alone: float
    shared: float


@dataclass(frozen=True, kw_only=True)
class SensitivityReport(Report):
    """How much each geometric error moves the platform (``pkm-sensitivity/1``).

    ``drawn``: machines of a Monte Carlo, closed exactly; None where none was asked for.
    """

    FORMAT: ClassVar[str] = "pkm-sensitivity/1"
    machine: str
    closure: str
    poses: int
    parameters: tuple[SensitivityEntry, ...]
    kinds: tuple[SensitivityEntry, ...]
    within_tolerances: PoseSpread
    tolerances: tuple[ToleranceEntry, ...]
    drawn: DrawnEntry | None = None
    _found: Sensitivity = field(repr=False, compare=False)

    def draw(self, file: File, *, each: bool = False) -> None:
        """Draw bars (png, svg, pdf): by kind of error, or each by itself."""
        from app.show.charts import sensitivity_chart

        found = self._found
        sensitivity_chart(found.parameters if each else found.kinds, self.machine, Path(file))


def sensitivity(
    machine: str,
    *,
    closure: str = "",
    position_um: float | None = None,
    orientation_mdeg: float | None = None,
    poses: int = 500,
    seed: int = 1,
    monte_carlo: int = 0,
    workers: int | None = None,
    scheduler: str = "",
    watch: Watch | None = None,
) -> SensitivityReport:
    """Tell what every geometric error does to the pose, mean and spread over the workspace.

    Sensitivity is not identifiability: see :func:`identifiability`.

    Parameters
    ----------
    machine : str
        Name of a shipped machine, or a machine file.
    closure : str
        Another closure of an over-constrained machine's file.
    position_um, orientation_mdeg : float, optional
        Wanted standard deviations; with one of them ``tolerances`` says what they ask for.
    poses : int
        Poses over the workspace.
    seed : int
        Draws them, and the machines.
    monte_carlo : int
        So many machines are drawn within their tolerances, each closed exactly at these poses:
        what they are off by stands in ``drawn``.
    workers : int, optional
        Processes that do it; one for each processor if not given.
    scheduler : str
        Address of a Dask scheduler in place of processes.
    watch : callable, optional
        Told how many of how many shares of the machines are done.

    Returns
    -------
    SensitivityReport
        mm and deg.

    Raises
    ------
    BadInput
        For a machine file that cannot be read, an accuracy that is not positive, machines of which
        none can take all of the poses, and a scheduler that does not answer.

    Examples
    --------
    >>> pkmcal.sensitivity("hexapod").kinds[0].name                          # doctest: +SKIP
    """
    for value, name in ((position_um, "position_um"), (orientation_mdeg, "orientation_mdeg")):
        if value is not None and value <= 0.0:
            raise BadInput(f"{name} is {value:g}", remedy="Give a positive accuracy.")
    chosen = closed_machine(machine, closure)
    where = workspace_poses(chosen, poses, np.random.default_rng(seed))
    found = global_sensitivity(where)
    wanted: tuple[Tolerance, ...] = ()
    if position_um is not None or orientation_mdeg is not None:
        wanted = tolerances(
            found,
            position=None if position_um is None else position_um * 1e-3,
            orientation=None if orientation_mdeg is None else orientation_mdeg * 1e-3 * DEGREE,
        )
    said = {
        "format": SensitivityReport.FORMAT,
        "machine": chosen.name,
        "closure": closure or "own",
        "poses": found.poses,
        "parameters": [_data(index) for index in found.parameters],
        "kinds": [_data(index) for index in found.kinds],
        "within_tolerances": {
            "position_rms_mm": found.position_sigma,
            "orientation_rms_deg": found.orientation_sigma / DEGREE,
        },
        "tolerances": [_tolerance(one) for one in wanted],
        "drawn": drawn_errors(where, monte_carlo, seed, workers, scheduler, watch)
        if monte_carlo
        else None,
    }
    return SensitivityReport.of(said, _found=found)


def _per(unit: str) -> tuple[str, float]:
    """Unit in which an error is told, and how much of the machine file's unit it is."""
    return ("deg", DEGREE) if unit == "rad" else (unit, 1.0)


def _data(index: Index) -> dict[str, Any]:
    unit, factor = _per(index.unit)
    return {
        "name": index.name,
        "per": unit,
        "position_mm": index.position * factor,
        "position_spread_mm": index.position_spread * factor,
        "orientation_deg": index.orientation * factor / DEGREE,
        "orientation_spread_deg": index.orientation_spread * factor / DEGREE,
        "tolerance": index.tolerance / factor,
        "position_share_mm": index.position_share,
        "orientation_share_deg": index.orientation_share / DEGREE,
    }


def _tolerance(tolerance: Tolerance) -> dict[str, Any]:
    unit, factor = _per(tolerance.unit)
    return {
        "kind": tolerance.kind,
        "unit": unit,
        "alone": tolerance.alone / factor,
        "shared": tolerance.shared / factor,
    }
