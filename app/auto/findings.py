"""What all runs together say: effects, what is in question, and the accuracy to be expected."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from app.auto.creeping import creep_of
from app.auto.decision import Creep
from app.auto.wording import found_words
from app.files.pose_table import Pose
from app.jobs.corrector import Corrector
from app.jobs.discovering import DiscoveryReport, discover
from calib.arrays import Array
from calib.errors import BadInput
from calib.mechanism.description import Machine
from calib.mechanism.rigid import Poses
from calib.mechanism.task import FULL, task_values
from calib.poses.verification import verification_poses

EVERY = 9
"""Of the verification poses each so-manieth is predicted, and verified: 24 of 216."""
NOTHING = "nothing"


@dataclass(frozen=True)
class Findings:
    """What a discovery over all runs has found.

    Attributes
    ----------
    runs : tuple of str
    model : str
        Model file that holds it.
    effects : tuple of str
    ambiguous : tuple of (str, str)
        An effect of the model and its rival; the rival of a weak one is "nothing".
    unexplained : bool
        Something is missing that no known effect explains.
    predicted_um : float
        RMS of the position error at fresh poses, by the covariance of what was identified.
    conditions : mapping of str to float
        Channels as they were at the end of the last run.
    creep : Creep, optional
        What was left then of a warm-up, where one was found.
    not_asked : mapping of str to str
        Effects that these readings cannot show, and why.
    """

    runs: tuple[str, ...]
    model: str
    effects: tuple[str, ...]
    ambiguous: tuple[tuple[str, str], ...]
    unexplained: bool
    predicted_um: float
    conditions: Mapping[str, float] = field(default_factory=dict)
    creep: Creep | None = None
    not_asked: Mapping[str, str] = field(default_factory=dict)

    @classmethod
    def from_json(cls, line: Mapping[str, Any]) -> "Findings":
        """Read a line of the journal."""
        return cls(
            tuple(line["runs"]), line["model"], tuple(line["effects"]),
            tuple((a, b) for a, b in line["ambiguous"]), line["unexplained"],
            line["predicted_um"], line["conditions"],
            Creep(**line["creep"]) if line.get("creep") else None,
            line.get("not_asked", {}),
        )  # fmt: skip

    def words(self) -> str:
        """One line for a person."""
        return found_words(vars(self))

    def other_conditions(self, wanted: Mapping[str, float], kg: float, kelvin: float) -> str:
        """Say which conditions would have to be changed; empty if none."""
        spare = {"payload_kg": kg}
        return ", ".join(
            f"{name} at {value:g}"
            for name, value in wanted.items()
            if abs(value - self.conditions.get(name, np.inf)) > spare.get(name, kelvin)
        )


def look(runs: tuple[str, ...], model: Path) -> Findings:
    """Discover what is missing over all runs and write the model.

    Raises
    ------
    BadInput
        If a run cannot be read.
    """
    report = discover(runs)
    report.save(model)
    corrector = Corrector.load(model)
    return Findings(
        runs,
        str(model),
        report.effects,
        _in_question(report),
        report.unexplained.significant,
        predicted(corrector),
        {name: ends[1] for name, ends in _channels(corrector).items()},
        creep_of(report.fitted, _fresh(corrector.machine)),
        dict(report.unavailable),
    )


def _fresh(machine: Machine) -> Array:
    """Fresh poses as columns (6, N)."""
    return np.array(list(fresh_poses(machine).values())).T


def _in_question(report: DiscoveryReport) -> tuple[tuple[str, str], ...]:
    """Every effect of the model with each rival that these readings leave it."""
    pairs: dict[tuple[str, str], None] = {}
    for step in report.steps:
        name = step.added
        if name is None or name not in report.effects:
            continue
        groups = [group for group in report.indistinguishable if name in group]
        for rival in (*step.rivals, *(other for group in groups for other in group)):
            if rival != name and rival not in report.effects:
                pairs[name, rival] = None
        if step.weak:
            pairs[name, NOTHING] = None
    return tuple(pairs)


def _channels(corrector: Corrector) -> Mapping[str, tuple[float, float]]:
    region = corrector.saved.region
    return {} if region is None else region.channels


def fresh_poses(machine: Machine) -> dict[str, Pose]:
    """Poses at which accuracy is predicted and verified; none of them is measured for a fit."""
    return dict(list(verification_poses(machine).by_label.items())[::EVERY])


def predicted(corrector: Corrector) -> float:
    """RMS in um of the position error at fresh poses, by the covariance of the model.

    Raises
    ------
    BadInput
        If no fresh pose can be commanded with the model.
    """
    machine = corrector.machine
    wanted = _fresh(machine)
    task = wanted if machine.task.coordinates == FULL else task_values(
        machine.task, Poses.from_xyz_rpy(wanted)
    )  # fmt: skip
    told = {name: 0.5 * (low + high) for name, (low, high) in _channels(corrector).items()}
    time_s = 0.0 if corrector.identified.needs_time else None
    solved = corrector.solve(task, told, time_s, corrector.history())
    good = np.array([not why for why in solved.commands.refused])
    if not good.any():
        raise BadInput(
            f"no fresh pose can be commanded: {solved.commands.refused[0]}",
            place=corrector.source,
            remedy="Look at the model: pkmcal fit, pkmcal report",
        )
    um, _ = solved.uncertainty()
    return float(np.sqrt(np.mean(um[good] ** 2)))
