"""Stations, reflectors, actuators and controllers that were not what the record says."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from bench.mistakes.clean import (
    at_rows,
    base_frame,
    from_part,
    machine_named,
    moved_actuators,
    moved_by,
    on_platform,
    platform_turns,
    read_nests,
    read_rows,
    with_header,
)
from calib.arrays import BoolArray
from calib.runs.record import Run

Chance = np.random.Generator
Make = Callable[[Run, Chance], Run]


def moved(low: float, high: float, first: float = 0.1, last: float = 0.9) -> Make:
    """The tracker moved by ``low`` to ``high`` mm at some moment between two parts of the run."""
    return lambda run, chance: moved_by(
        run, from_part(run, chance.uniform(first, last)), chance.uniform(low, high), chance
    )


def turned(run: Run, chance: Chance) -> Run:
    """The tracker turned by about 1 mrad where it stands."""
    which = from_part(run, chance.uniform(0.2, 0.8))
    angle = 1e-3 * chance.choice([-1.0, 1.0])
    turn = np.array(
        [[np.cos(angle), -np.sin(angle), 0.0], [np.sin(angle), np.cos(angle), 0.0], [0, 0, 1.0]]
    )
    position = run.position.copy()
    position[:, which] = turn @ position[:, which]
    return replace(run, position=position)


def moved_twice(run: Run, chance: Chance) -> Run:
    """The tracker moved by some millimetres at a third and at two thirds."""
    for part in (0.33, 0.66):
        run = moved_by(run, from_part(run, part), chance.uniform(2.0, 10.0), chance)
    return run


def moved_unseen(run: Run, chance: Chance) -> Run:
    """It moved by 1 mm to 5 mm, and the base nests were read at the start alone."""
    read = read_rows(run)
    base = np.array([run.nest[k] in run.header.base_nests for k in read])
    first = int(np.flatnonzero(~base)[0])
    gone = at_rows(run, read[first:][base[first:]])
    run = replace(
        run,
        measured=run.measured & ~gone,
        nest=tuple("" if out else n for n, out in zip(run.nest, gone, strict=True)),
    )
    return moved(1.0, 5.0)(run, chance)


def _lifted(run: Run, which: BoolArray, height: float) -> Run:
    """An SMR ``height`` mm higher: along the normal of each nest, z of platform and of base."""
    turns = platform_turns(run, machine_named(run.header.machine))
    upright = np.where(on_platform(run), turns[:, 2, :], base_frame(run)[0][:, [2]])
    return replace(run, position=run.position + np.where(which, height * upright, 0.0))


def other_smr(low: float, high: float, first: float = 0.0) -> Make:
    """One nest is read with an SMR of another radius, from a part of its readings on."""

    def make(run: Run, chance: Chance) -> Run:
        name = str(chance.choice(read_nests(run)))
        rows = np.array([k for k in read_rows(run) if run.nest[k] == name])
        which = at_rows(run, rows[int(first * rows.size) :])
        return _lifted(run, which, chance.choice([-1.0, 1.0]) * chance.uniform(low, high))

    return make


def other_smr_everywhere(run: Run, chance: Chance) -> Run:
    """From the middle on every nest is read with an SMR 7.9375 mm smaller."""
    return _lifted(run, from_part(run, 0.5), -7.9375)


def other_smr_throughout(run: Run, chance: Chance) -> Run:
    """Every platform nest is read with an SMR 7.9375 mm smaller, those of the base are not."""
    return _lifted(run, on_platform(run), -7.9375)


def other_reflector_once(run: Run, chance: Chance) -> Run:
    """At one pose another reflector was chosen: its range is 3 to 8 mm off."""
    row = int(chance.choice(np.flatnonzero(on_platform(run))))
    position = run.position.copy()
    along = position[:, row] / np.linalg.norm(position[:, row])
    position[:, row] += along * chance.uniform(3.0, 8.0)
    return replace(run, position=position)


def range_off(run: Run, chance: Chance) -> Run:
    """From the middle on all ranges are 3 to 8 mm too long: another reflector was chosen."""
    position = run.position.copy()
    which = from_part(run, 0.5)
    along = position / np.linalg.norm(position, axis=0)
    return replace(
        run, position=np.where(which, position + along * chance.uniform(3.0, 8.0), position)
    )


def _actuators(run: Run, change: np.ndarray) -> Run:
    return moved_actuators(run, machine_named(run.header.machine), change)


def _unit(run: Run) -> float:
    """A tenth of a degree where actuators turn, a millimetre where they extend."""
    return 2e-3 if machine_named(run.header.machine).actuators[0].unit == "rad" else 1.0


def slipped(low: float, high: float) -> Make:
    """One actuator stands ``low`` to ``high`` mm off from some moment on."""

    def make(run: Run, chance: Chance) -> Run:
        change = np.zeros_like(run.q)
        size = chance.choice([-1.0, 1.0]) * chance.uniform(low, high) * _unit(run)
        k = int(chance.integers(change.shape[0]))
        change[k, np.arange(run.line.size) >= chance.uniform(0.2, 0.8) * run.line.size] = size
        return _actuators(run, change)

    return make


def clamped(run: Run, chance: Chance) -> Run:
    """From two thirds on one actuator no longer moves."""
    k, first = int(chance.integers(run.q.shape[0])), 2 * run.line.size // 3
    change = np.zeros_like(run.q)
    change[k, first:] = run.q[k, first] - run.q[k, first:]
    return _actuators(run, change)


def mistyped(run: Run, chance: Chance) -> Run:
    """One q of one pose was typed otherwise than it was commanded: 1 to 5 mm off."""
    labels = list(dict.fromkeys(p for p, on in zip(run.pose, on_platform(run), strict=True) if on))
    label, q = str(chance.choice(labels)), run.q.copy()
    here = np.array([pose == label for pose in run.pose])
    q[int(chance.integers(q.shape[0])), here] += chance.uniform(1.0, 5.0) * _unit(run)
    return replace(run, q=q)


def mistyped_row(run: Run, chance: Chance) -> Run:
    """The same in one row alone."""
    row, q = int(chance.choice(np.flatnonzero(on_platform(run)))), run.q.copy()
    q[int(chance.integers(q.shape[0])), row] += chance.uniform(1.0, 5.0) * _unit(run)
    return replace(run, q=q)


def not_gone(run: Run, chance: Chance) -> Run:
    """At one pose the machine did not move: the readings are of the pose before."""
    on = on_platform(run)
    other = np.any(np.diff(run.q, axis=1, prepend=run.q[:, :1]) != 0.0, axis=0)
    rows = np.flatnonzero(on & np.roll(on, 1) & other)[1:]
    row = int(chance.choice(rows))
    change = np.zeros_like(run.q)
    here = [k for k in range(row, run.line.size) if np.array_equal(run.q[:, k], run.q[:, row])]
    near = [k for k in here if k - row < 4]
    change[:, near] = run.q[:, [row - 1]] - run.q[:, near]
    return _actuators(run, change)


def column_stands(run: Run, chance: Chance) -> Run:
    """One column of q repeats its first value while the actuator moved."""
    q = run.q.copy()
    k = int(chance.integers(q.shape[0]))
    q[k] = q[k, 0]
    return replace(run, q=q)


def commands_late(run: Run, chance: Chance) -> Run:
    """Each q is that of the row before: the program logged the command before the last one."""
    q = run.q.copy()
    q[:, 1:] = run.q[:, :-1]
    return replace(run, q=q)


def controller_not_stated(run: Run, chance: Chance) -> Run:
    """The file states corrected parameters that the controller did not hold."""
    machine = machine_named(run.header.machine)
    names = [a.reference for a in machine.actuators if isinstance(a.reference, str)]
    unit = 5e-3 if machine.actuators[0].unit == "rad" else 2.0
    stated = {
        str(name): float(machine.nominal[machine.index(str(name))] + chance.normal() * unit)
        for name in chance.choice(names, min(3, len(names)), replace=False)
    }
    return with_header(run, controller_parameters={**run.header.controller_parameters, **stated})
