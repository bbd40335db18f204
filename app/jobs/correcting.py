"""What to command so that the machine, as a model knows it, comes to the wanted poses."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from app.files.wanted_poses import Wanted, read_wanted
from app.jobs.chosen_runs import File, path_of
from app.jobs.corrector import PAYLOAD, TEMPERATURE, Corrector, Solved
from app.jobs.record import Record, Report
from calib.arrays import Array
from calib.command import History
from calib.errors import BadInput

Coordinates = Sequence[float] | Array


@dataclass(frozen=True, kw_only=True)
class CorrectedEntry(Record):
    """Commands for one wanted pose; mm and rad.

    ``q``: actuator coordinates; ``pose``: x, y, z, rx, ry, rz to tell a controller that computes
    with its own parameters instead; ``stands``: where the platform then is by the model, with the
    standard uncertainty that the model's covariance gives it; ``outside``: in words, how far the
    pose lies outside of where the model was measured.
    """

    pose_name: str
    wanted: Mapping[str, float]
    q: tuple[float, ...]
    pose: tuple[float, ...]
    stands: tuple[float, ...]
    uncertainty_um: float
    uncertainty_mdeg: float
    outside: tuple[str, ...]


@dataclass(frozen=True, kw_only=True)
class CorrectReport(Report):
    """Commands for wanted poses (``pkm-correct/1``).

    ``effects`` are in the commands, ``left_out`` are not, with the reason; ``channels`` hold what
    was told or did not vary while the model was measured, by pose.
    """

    FORMAT: ClassVar[str] = "pkm-correct/1"
    machine: str
    model: str
    actuators: tuple[str, ...]
    effects: tuple[str, ...]
    left_out: Mapping[str, str]
    remarks: tuple[str, ...]
    channels: Mapping[str, tuple[float, ...]]
    poses: tuple[CorrectedEntry, ...]


def correct(
    model: File,
    poses: File | Mapping[str, Coordinates] | Sequence[Coordinates],
    *,
    machine: str | None = None,
    payload: float | None = None,
    temperature: float | None = None,
    channels: Mapping[str, float] | None = None,
    every: float | None = None,
    before: Coordinates | None = None,
    extrapolate: bool = False,
) -> CorrectReport:
    """Compute what to command so that the platform comes to the wanted poses. Nothing moves.

    Parameters
    ----------
    model : path
        A saved model, as :meth:`FitReport.save` writes it.
    poses : path, mapping or sequence
        A poses file or a table, or task coordinates (or whole poses) in mm and rad, with names or
        without. They are visited in that order: what the machine remembers counts.
    machine : str, optional
        Shipped machine or machine file, where it is not the one that the model names.
    payload, temperature : float, optional
        Payload in kg, and temperature of the structure in deg C.
    channels : mapping, optional
        Other state readings that the model's effects depend on, by name.
    every : float, optional
        Seconds from pose to pose, for what fades with time; a table may have a column ``time_s``.
    before : sequence of float, optional
        Pose to which the machine was sent, corrected like these, before the first; home if None.
    extrapolate : bool
        Whether poses outside of where the model was measured are answered, too.

    Raises
    ------
    BadInput
        For what cannot be read, is out of reach, or depends on something that is not told.
    GateRefused
        For a pose outside of where the model was measured.

    Examples
    --------
    >>> found = pkmcal.correct("model.toml", [(0, 0, 220, 0, 0, 0)], payload=5)  # doctest: +SKIP
    >>> found.poses[0].q                                                     # doctest: +SKIP
    (230.61, 230.74, 230.7, 230.68, 230.72, 230.7)
    """
    path = path_of(model)
    assert path is not None
    corrector = Corrector.load(path, machine)
    wanted = _wanted(corrector, poses)
    told = dict(channels or {})
    told |= {} if payload is None else {PAYLOAD: payload}
    told |= {} if temperature is None else {TEMPERATURE: temperature}
    return report_of(corrector, wanted, told, every, before, extrapolate)


def report_of(
    corrector: Corrector,
    wanted: Wanted,
    told: Mapping[str, float],
    every: float | None,
    before: Coordinates | None,
    extrapolate: bool,
) -> CorrectReport:
    """Solve for poses in their order; raises as :func:`correct` does."""
    count = len(wanted.names)
    both = sorted(set(told) & set(wanted.channels))
    if both:
        raise BadInput(
            f"{both[0]} is a column of the table and told beside it", remedy="Say it once"
        )
    every_s = None if every is None else every * np.arange(1.0, count + 1.0)
    time_s = every_s if wanted.time_s is None else wanted.time_s
    columns: dict[str, float | Array] = {**wanted.channels, **told}
    history = corrector.history()
    if before is not None:
        history = _sent_before(corrector, before, {n: _first(v) for n, v in columns.items()})
    solved = corrector.solve(wanted.task, columns, time_s, history)
    solved.check(wanted.names, extrapolate=extrapolate)
    return _report(corrector, wanted, solved)


def _report(corrector: Corrector, wanted: Wanted, solved: Solved) -> CorrectReport:
    said = {
        "format": CorrectReport.FORMAT,
        "machine": corrector.machine.name,
        "model": corrector.source,
        "actuators": [one.name for one in corrector.machine.actuators],
        "effects": [found.effect.id for found in corrector.identified.effects],
        "left_out": dict(corrector.left_out),
        "remarks": corrector.remarks,
        "channels": {name: list(values) for name, values in solved.channels.items()},
        "poses": [
            {"pose_name": name, **entry}
            for name, entry in zip(wanted.names, solved.entries(), strict=True)
        ],
    }
    return CorrectReport.of(said)


def _sent_before(corrector: Corrector, pose: Coordinates, channels: Mapping[str, float]) -> History:
    """A machine that was sent from home to a pose."""
    task = corrector.task_of(list(pose), "the pose before")[:, None]
    found = corrector.solve(task, channels, 0.0, corrector.history()).commands
    if found.refused[0]:
        raise BadInput(found.refused[0], place="the pose before", remedy="Name another one")
    return found.history


def _first(values: float | Array) -> float:
    return float(np.ravel(np.asarray(values))[0])


def _wanted(
    corrector: Corrector, poses: File | Mapping[str, Coordinates] | Sequence[Coordinates]
) -> Wanted:
    if isinstance(poses, Mapping):
        named = {str(name): list(values) for name, values in poses.items()}
    elif isinstance(poses, Sequence | np.ndarray) and not isinstance(poses, str):
        named = {str(k + 1): list(values) for k, values in enumerate(poses)}
    else:
        path = path_of(poses)
        assert path is not None
        return read_wanted(path, corrector.machine)
    if not named:
        raise BadInput("there is no pose", remedy="Give at least one")
    task = np.stack([corrector.task_of(v, f"pose {n}") for n, v in named.items()], axis=1)
    return Wanted(tuple(named), task)
