"""An effect that belongs to one run of several: ``backlash@2`` acts in the second run alone.

Last year's run beside today's: geometry and what both share is fitted to both, and what has come
between them is a difference with its own value and uncertainty. It says what was so in that run,
not what the machine is, and so is never written to one.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import fields, replace

import numpy as np

from calib.arrays import Array, BoolArray
from calib.effects.component import Effect, Signature, Situation
from calib.mechanism.description import Machine
from calib.runs.stack import Rows
from calib.unknown import Unknown

MARK = "@"


class OfOneRun(Effect):
    """Another effect, in one run alone.

    Parameters
    ----------
    effect : Effect
    number : int
        Of the run, counted from 1 in the order in which the runs are given.
    """

    kind = "measurement"

    def __init__(self, effect: Effect, number: int) -> None:
        self.effect, self.number = effect, number
        self.id = f"{effect.id}{MARK}{number}"
        self.says = f"in run {number} alone: {effect.says}"
        self.channels = effect.channels
        self.depends = tuple(dict.fromkeys((*effect.depends, "run")))
        self.ends_with_run = True

    def lacking(self, machine: Machine) -> str:
        """As the effect itself; one that closes the machine in another way is of all runs."""
        if type(self.effect).closure is not Effect.closure:
            return "it changes how the machine closes, and so is of all runs"
        return self.effect.lacking(machine)

    def unavailable(self, rows: Rows) -> str:
        """The run must be there, and show the effect."""
        if not self._own(rows).any():
            return f"there is no run {self.number}"
        return self.effect.unavailable(rows.take(self._own(rows)))

    def told(self, rows: Rows) -> BoolArray:
        """Other runs need not say anything of it."""
        return self.effect.told(rows) | ~self._own(rows)

    def unknowns(self, rows: Rows) -> tuple[Unknown, ...]:
        """Those of the effect, ``backlash@2.leg1`` for ``backlash.leg1``."""
        own = self.effect.unknowns(rows)
        stem = len(self.effect.id)
        return tuple(replace(one, name=self.id + one.name[stem:]) for one in own)

    def parts(self, rows: Rows) -> tuple[tuple[int, ...], ...]:
        """As the effect itself."""
        return self.effect.parts(rows)

    def trials(self, rows: Rows) -> Iterator[tuple[float, ...]]:
        """As the effect itself, for that run."""
        return self.effect.trials(rows.take(self._own(rows)))

    def trials_beside(self, rows: Rows, held: Mapping[str, Array]) -> Iterator[tuple[float, ...]]:
        """As the effect itself, for that run."""
        return self.effect.trials_beside(rows.take(self._own(rows)), held)

    def signature(self, situation: Situation, values: Array) -> Signature:
        """That of the effect, nothing in other runs."""
        made = self.effect.signature(situation, values)
        own = self._own(situation.rows)
        parts = {one.name: getattr(made, one.name) for one in fields(made)}
        return Signature(**{k: None if v is None else v * own for k, v in parts.items()})

    def _own(self, rows: Rows) -> BoolArray:
        return np.asarray(rows.run == self.number - 1)


def each_alone(effects: Sequence[Effect], rows: Rows) -> tuple[Effect, ...]:
    """Machine effects that may be of one run alone, for each of several runs."""
    if len(rows.runs) < 2:
        return ()
    one = replace(rows, runs=rows.runs[:1])
    may = [
        effect
        for effect in effects
        if effect.kind == "machine"
        and not effect.ends_with_run
        and not effect.beside
        and len(effect.unknowns(rows)) == len(effect.unknowns(one))
        and not OfOneRun(effect, 1).lacking(rows.machine)
    ]
    return tuple(OfOneRun(effect, 1 + run) for effect in may for run in range(len(rows.runs)))


def of_one_run(identifier: str) -> tuple[str, int] | None:
    """Effect and number of the run that ``backlash@2`` names; None for another identifier."""
    name, mark, number = identifier.rpartition(MARK)
    return (name, int(number)) if mark and number.isdigit() and int(number) > 0 else None
