"""Poses that are to show what a machine may hide, beside those that are chosen for accuracy.

Every effect of the catalogue is supposed at size 1 in turn. What a fit of geometry and frame
leaves of it is its non-centrality delta (:mod:`calib.evidence.next_experiment`); pose after pose
the one is taken that lowers sum exp(-delta / SEEN) most: what is seen already counts no more. A
pose is approached from the one before, and those of the plan are offered once more: another way to
the same place, and a repeat.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from calib.arrays import Array
from calib.discover.follow_up import FollowUp
from calib.effects.component import Effect
from calib.evidence.next_experiment import Separation
from calib.identify.fitting import Fit
from calib.identify.signatures import EffectColumns, effect_columns
from calib.model.columns import at_trial
from calib.poses.reach import PoseSet
from calib.runs.stack import Rows

SEEN = 20.0
"""Non-centrality with which an effect is about to be called for, everything looked at paid for."""
OF_THE_WAY = {"path", "step", "direction", "time_s"}
"""State columns that hang on how the machine came to a pose."""


@dataclass(frozen=True, eq=False)
class _Question:
    """An effect at one trial, with amplitudes of its linear unknowns, and how far it is seen."""

    columns: EffectColumns
    trial: int
    amplitudes: Array
    seen: Separation
    still: Array | None
    """Displacement (C, m) at the poses, where it does not hang on the way to them."""


def explore(
    fitted: Fit, effects: Sequence[Effect], offered: PoseSet, count: int, rng: np.random.Generator
) -> list[int]:
    """Choose ``count`` of the offered poses, in the order of their visit; indices.

    Parameters
    ----------
    fitted : Fit
        Of the run that the other poses of the plan would give.
    effects : sequence of Effect
    offered : PoseSet
    count : int
    rng : numpy Generator
    """
    follow = FollowUp(fitted, offered, {})
    follow.rows = _in_their_pass(follow.rows, fitted.model.rows)
    setup = len(fitted.model.setup.unknowns)
    shape = follow.geometry.shape[1:]
    shared = np.concatenate([follow.geometry, np.zeros((setup, *shape)), follow.frame])
    nuisance = follow.by_pose(shared)
    rows = follow.approached([])
    asked = [
        question
        for one in effect_columns(fitted, effects)
        if (question := _question(fitted, follow, rows, one, rng)) is not None
    ]
    chosen: list[int] = []
    while len(chosen) < count:
        rows = follow.approached(chosen)
        worth = np.zeros(offered.count)
        moved = [_moved(follow, rows, question) for question in asked]
        for question, displacement in zip(asked, moved, strict=True):
            now, gain = question.seen.delta, question.seen.gains(nuisance, displacement)
            worth += np.exp(-now / SEEN) - np.exp(-(now + gain) / SEEN)
        worth[chosen] = -np.inf
        best = int(np.argmax(worth))
        for question, displacement in zip(asked, moved, strict=True):
            question.seen.add(nuisance[best], displacement[best])
        chosen.append(best)
    return chosen


def _in_their_pass(then: Rows, now: Rows) -> Rows:
    """Poses of one run with the others: each nest is read when its pass is, in its conditions."""
    names = np.array(now.nest_name)
    own = {name: names == name for name in dict.fromkeys(then.nest_name)}

    def usual(values: Array) -> Array:
        return np.array([float(np.mean(values[own[name]])) for name in then.nest_name])

    return replace(
        then,
        time_s=usual(now.time_s),
        progress=usual(now.progress),
        channels={name: usual(values) for name, values in now.channels.items()},
    )


def _question(
    fitted: Fit, follow: FollowUp, rows: Rows, one: EffectColumns, rng: np.random.Generator
) -> _Question | None:
    """An effect of size 1; None where no pose shows anything of it."""
    trial = int(rng.integers(len(one.trials)))
    linear = [unknown for unknown in one.unknowns if not unknown.nonlinear]
    sizes = np.array([unknown.size for unknown in linear])
    amplitudes = sizes * rng.standard_normal(sizes.size)
    there = _displaced(follow, rows, one, trial, amplitudes)
    size = float(np.sqrt(np.mean(there**2)))
    if not size > 0.0:
        return None
    amplitudes = amplitudes / size
    now = np.asarray(amplitudes @ fitted.whiten(one.at(trial)))
    still = None if OF_THE_WAY & set(one.effect.depends) else there / size
    seen = Separation(fitted.jacobian, fitted.prior_precision, now)
    return _Question(one, trial, amplitudes, seen, still)


def _moved(follow: FollowUp, rows: Rows, question: _Question) -> Array:
    if question.still is not None:
        return question.still
    return _displaced(follow, rows, question.columns, question.trial, question.amplitudes)


def _displaced(
    follow: FollowUp, rows: Rows, one: EffectColumns, trial: int, amplitudes: Array
) -> Array:
    """Displacement (C, m) of what is read at the poses, in sigmas."""
    values = at_trial(one.unknowns, one.trials[trial])
    columns = follow.columns(one.effect, values, rows)
    return np.asarray(follow.by_pose(np.tensordot(amplitudes, columns, axes=1)[None])[:, 0])
