"""What a machine file describes, and whether it can work."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np

from app.files.machines import closed_machine
from app.jobs.record import Record, Report
from app.show.machine_words import inspection_data, inspection_words
from calib.analysis.inspection import inspect
from calib.poses.verification import verification_poses

Span = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class LimbEntry(Record):
    """A limb: its passive joints, and the directions in which it holds the platform."""

    name: str
    passive_joints: int
    wrenches: int


@dataclass(frozen=True, kw_only=True)
class MachineCheckReport(Report):
    """What a machine file describes (``pkm-machine-check/1``); mm and rad.

    ``used`` and ``verification_box`` hold the lowest and highest value of each actuator, joint and
    coordinate; ``stopped_by`` the part of the workspace box that each limit keeps out of reach.
    """

    FORMAT: ClassVar[str] = "pkm-machine-check/1"
    machine: str
    limbs: tuple[LimbEntry, ...]
    parameters: int
    actuators: tuple[str, ...]
    task: tuple[str, ...]
    home_gap_mm: float
    home_gap_rad: float
    home_pose: tuple[float, ...]
    constraints: int
    redundant: int
    freedoms_held: int
    mobility: int
    rank: int
    stiffness_home: float
    stiffness_least: float
    reach: float
    stopped_by: Mapping[str, float]
    used: Mapping[str, Span]
    verification_box: Mapping[str, Span]
    verification_scale: float
    closures: tuple[str, ...]
    traits_stated: bool
    traits: Mapping[str, tuple[str, ...]]
    effects: tuple[str, ...]
    not_on_this_machine: Mapping[str, str]
    _text: str = field(repr=False, compare=False)

    @property
    def text(self) -> str:
        """What the verb prints."""
        return self._text


def check_machine(machine: str, *, closure: str = "", seed: int = 1) -> MachineCheckReport:
    """Read a machine file and tell what it describes: mobility, rank, limits, reach, effects.

    Parameters
    ----------
    machine : str
        Name of a shipped machine, or a machine file.
    closure : str
        Another closure of an over-constrained machine's file.
    seed : int
        Draws the poses that are tried.

    Returns
    -------
    MachineCheckReport

    Raises
    ------
    BadInput
        For a file that cannot work: the line, and what to do.

    Examples
    --------
    >>> pkmcal.check_machine("hexapod").redundant                            # doctest: +SKIP
    0
    """
    chosen = closed_machine(machine, closure)
    found = inspect(chosen, np.random.default_rng(seed))
    grid = verification_poses(chosen)
    return MachineCheckReport.of(inspection_data(found, grid), _text=inspection_words(found, grid))
