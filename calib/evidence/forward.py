"""Add the missing effects one by one: diagnose, add the best, refit, and see the error fall.

An effect is accepted only if held-out poses are predicted no worse with it than without; where
one is refused the next is tried, and it may come back once another has been accepted: alone, with
what else is missing, it may be drawn away from its value. In the end every effect must still be
called for beside the others: one that a later effect has made superfluous is taken out.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Protocol

from calib.evidence.family import ALPHA, significant
from calib.evidence.findings import Diagnosis

MOST_STEPS = 8
SLACK = 1e-6
"""Relative rise of the hold-out error that counts as none (rounding of a refit)."""

WEAK = 1e-3
"""p-value above which one effect *more* is but a hint: one run in twenty shows such by chance."""
BY_CHANCE = 0.02
"""Relative change of the hold-out error by an unknown that is of no use, either way."""


class Stage(Protocol):
    """A refitted model and what is missing from it; the diagnosis may be made when asked for."""

    @property
    def effects(self) -> tuple[str, ...]:
        """Effects in the model."""

    @property
    def holdout(self) -> float:
        """RMS over held-out poses."""

    @property
    def diagnosis(self) -> Diagnosis:
        """What is missing from the refitted model."""

    @property
    def doubtful(self) -> frozenset[str]:
        """Effects in the model that might as well not be: only these need to be tried without."""


@dataclass(frozen=True)
class Revision:
    """What was done: ``added`` or ``removed`` an effect (both None at the start)."""

    stage: Stage
    added: str | None = None
    removed: str | None = None


@dataclass(frozen=True)
class Discovery:
    """The staircase: accepted steps, effects refused in the end, and groups seen on the way."""

    steps: tuple[Revision, ...]
    refused: tuple[str, ...]
    indistinguishable: tuple[tuple[str, ...], ...]
    impossible: tuple[str, ...] = ()
    """Effects refused for a value that nothing has: called for so weakly that it is chance."""

    @property
    def last(self) -> Stage:
        """The model in the end."""
        return self.steps[-1].stage


def discover(
    refit: Callable[[tuple[str, ...]], Stage],
    begin: tuple[str, ...] = (),
    *,
    keep: Sequence[str] = (),
    first: Sequence[str] = (),
    forbids: Callable[[Stage, str], bool] = lambda stage, name: False,
) -> Discovery:
    """Go from the effects ``begin`` to a model from which nothing known is missing.

    Parameters
    ----------
    refit : callable
        Refits the model with the named effects and answers a :class:`Stage`.
    begin : tuple of str
        Effects in the model at the start.
    keep : sequence of str
        Effects that stay: those that the operator has put in, and ``first``.
    first : sequence of str
        Effects that are added before any is looked for.
    forbids : callable
        Whether physics forbids the value that an effect would have in a stage. A weak call for such
        a one is refused, and then nothing else is added on a weak call either.
    """
    steps = [Revision(refit(begin))]
    for name in first:
        steps.append(Revision(refit((*steps[-1].stage.effects, name)), added=name))
    refused: list[str] = []
    groups: list[tuple[str, ...]] = []
    impossible: list[str] = []
    while len(steps) <= MOST_STEPS:
        now = steps[-1].stage
        discovered = len(steps) > 1 + len(first)
        added = _next(now, refused, WEAK if discovered or impossible else ALPHA)
        if added is None:
            break
        if weakly(now.diagnosis, added) and forbids(now, added):
            refused.append(added)
            impossible.append(added)
            continue
        tried = refit((*now.effects, added))
        if speaks_against(now.holdout, tried.holdout):
            refused.append(added)
            continue
        # Groups of what was called for after it belong to other models.
        own = [group for group in now.diagnosis.indistinguishable if group[0] == added]
        groups += [group for group in own if group not in groups]
        steps.append(Revision(tried, added=added))
        refused, impossible = [], []
    steps += _superfluous(refit, steps, frozenset((*begin, *keep)))
    last = steps[-1].stage.effects
    here = [group for group in groups if set(group) & set(last)]
    return Discovery(tuple(steps), tuple(refused), tuple(here), tuple(impossible))


def weakly(diagnosis: Diagnosis, name: str) -> bool:
    """Whether an effect is called for by a p-value that chance may well make."""
    found = next((one for one in diagnosis.findings if one.name == name), None)
    return found is not None and not significant(found.log_p, WEAK)


def speaks_against(before: float, after: float) -> bool:
    """Whether held-out poses refuse a larger model, by the RMS over them without and with it.

    They do where they are predicted worse, or not at all (infinite); nan decides nothing.
    """
    return math.isinf(after) or after > before * (1.0 + SLACK)


def _next(stage: Stage, refused: Sequence[str], limit: float) -> str | None:
    """Name the best effect whose p-value is below ``limit`` and that has not been refused.

    First those that explain the residual one after the other: the second may be significant only
    beside the first.
    """
    diagnosis = stage.diagnosis
    if diagnosis.unknown_preferred or not diagnosis.explained_by:
        return None
    called_for = [f.name for f in diagnosis.findings if significant(f.log_p, ALPHA)]
    clear = {f.name for f in diagnosis.findings if significant(f.log_p, limit)}
    # What is significant only beside another is not asked to be clear without it.
    if limit == ALPHA or diagnosis.explained_by[0] in clear:
        clear |= set(diagnosis.explained_by)
    offered = (*diagnosis.explained_by, *called_for)
    return next((name for name in offered if name in clear and name not in refused), None)


def hints(
    diagnosis: Diagnosis, effects: Sequence[str], impossible: Sequence[str] = ()
) -> tuple[str, ...]:
    """Effects that a model with ``effects`` might have besides, called for too weakly to be added.

    Where nothing is in the model yet there are none: the first question is one question. It has
    been answered where what was called for first is ``impossible``.
    """
    called = diagnosis.explained_by
    if (
        not (effects or impossible)
        or diagnosis.unknown_preferred
        or diagnosis.unexplained.significant
    ):
        return ()
    weak = {f.name for f in diagnosis.findings if not significant(f.log_p, WEAK)}
    return called if all(name in weak for name in called) else ()


def _superfluous(
    refit: Callable[[tuple[str, ...]], Stage], taken: Sequence[Revision], keep: frozenset[str]
) -> list[Revision]:
    """Take out effects, the first added first, that the others have made superfluous.

    The hold-out may rise by ``BY_CHANCE``, but not to where it was before the last effect.
    """
    steps: list[Revision] = []
    before = taken[-2].stage.holdout if len(taken) > 1 else float("inf")
    for name in taken[-1].stage.effects:
        now = steps[-1].stage if steps else taken[-1].stage
        if name in keep or len(now.effects) < 2 or name not in now.doubtful:
            continue
        without = refit(tuple(other for other in now.effects if other != name))
        limit = min(now.holdout * (1.0 + BY_CHANCE), before)
        if without.holdout <= limit and without.diagnosis.adequate:
            steps.append(Revision(without, removed=name))
    return steps
