"""What a plan of poses will and will not be able to see, before anything is measured.

The run that the plan would give is made by the engine, without noise; every effect of the catalogue
is hidden in it at size 1, some times over, and the decision of a diagnosis is rehearsed on its null
draws (:func:`calib.evidence.pairs.power`). Size 1 moves the readings by as much as their noise: the
root mean square of the displacement, before any fit, is sqrt(3) sigma of a reading.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array
from calib.discover.diagnosis import diagnose_fit
from calib.effects.component import Effect
from calib.evidence.candidate import Candidate
from calib.evidence.pairs import power
from calib.identify.fitting import Fit, fit
from calib.model import Model
from calib.model.prototype import prototype_run
from calib.poses.reach import PoseSet
from calib.runs import Header
from calib.runs.stack import stack

QUIET = 1e-6
"""Noise of the planned run, in what its readings state: none, but to keep numbers apart."""
WARMER_K = 6.0
"""How much the structure warms during a run."""
ROOM_C = 20.0
DRAWN = 4
"""How often each effect is hidden at a value of what is searched: every other time in one leg, nest
or axis alone."""


@dataclass(frozen=True)
class Sight:
    """How well a plan sees an effect of size 1: probability that it is significant.

    ``power`` over the first, the middle and the last value of what is searched (a period, a
    moment), ``least`` at the worst of them, ``at``.
    """

    effect: str
    power: float
    least: float
    at: tuple[float, ...]


def planned_fit(
    machine_named: str, poses: PoseSet, header: Header | None, sigma_mm: float, payload_kg: float
) -> Fit:
    """The fit of the run that a plan would give, without noise.

    Parameters
    ----------
    machine_named : str
        How a run would name the machine.
    poses : PoseSet
        In the order of the visit; every nest is carried through all of them in turn.
    header : Header, optional
        Nests and load; without, nests as large as the machine and no load.
    sigma_mm : float
        Standard uncertainty of a reading per axis.
    payload_kg : float
        What is carried.
    """
    machine = poses.machine
    made = prototype_run(
        machine, machine_named, poses, machine.nominal, sigma_mm, np.random.default_rng(1),
        header=header, noise=QUIET,
    )  # fmt: skip
    rows = made.run.time_s.size
    channels = {"structure_temp_C": ROOM_C + WARMER_K * np.linspace(0.0, 1.0, rows)}
    if header is not None and header.load is not None:
        channels["payload_kg"] = np.full(rows, payload_kg)
    run = replace(made.run, channels=channels)
    return fit(Model(stack(machine, [run])))


def foreseen(fitted: Fit, effects: Sequence[Effect], rng: np.random.Generator) -> tuple[Sight, ...]:
    """What the readings of a planned fit will see of every effect that they can be asked for."""
    answer = diagnose_fit(fitted, effects, rng)
    scores, family = answer.diagnosis.scores, answer.diagnosis.family
    found = []
    for index, candidate in enumerate(scores.candidates):
        if candidate.channel:
            continue
        last = len(candidate.trials) - 1
        chances = {
            trial: np.mean(
                [power(scores, family, index, moved) for moved in _hidden(candidate, trial, rng)]
                or [0.0]
            )
            for trial in dict.fromkeys((0, last // 2, last))
        }
        worst = min(chances, key=lambda trial: chances[trial])
        mean, least = float(np.mean(list(chances.values()))), float(chances[worst])
        found.append(Sight(candidate.name, mean, least, candidate.trials[worst]))
    answer.diagnosis.release()
    return tuple(sorted(found, key=lambda one: one.power))


def _hidden(candidate: Candidate, trial: int, rng: np.random.Generator) -> list[Array]:
    """Displacements (R,) of the readings by an effect at size 1, in their sigmas."""
    columns, parts = candidate.columns[trial], candidate.subsets
    found = []
    for draw in range(DRAWN):
        amplitudes = candidate.sizes * rng.standard_normal(candidate.sizes.size)
        if draw % 2 and parts:
            alone = np.zeros_like(amplitudes)
            part = list(parts[rng.integers(len(parts))])
            alone[part] = amplitudes[part]
            amplitudes = alone
        moved = np.asarray(amplitudes @ columns)
        size = float(np.sqrt(np.mean(moved**2)))
        if size > 0.0:
            found.append(moved / size)
    return found
