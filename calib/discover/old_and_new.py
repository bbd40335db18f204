"""Old readings and those of a follow-up over one list of unknowns, for both sides of a question."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.discover.follow_up import FollowUp, own_to_each_run
from calib.effects.component import Effect
from calib.evidence.candidate import Candidate
from calib.evidence.next_experiment import CandidateBlocks, Separation
from calib.identify.fitting import Fit
from calib.identify.signatures import EffectColumns
from calib.model.columns import at_trial
from calib.runs.stack import Rows
from calib.unknown import linear_among


@dataclass(frozen=True, eq=False)
class Side:
    """One effect that may be the truth.

    Attributes
    ----------
    columns : EffectColumns
    candidate : Candidate
        The same over the accepted readings.
    trial : int
        Where its nonlinear unknowns stand.
    amplitudes : (k,)
        Size of its linear unknowns if it is the truth.
    own : bool
        Every run has its own unknowns of it (a drift).
    stands : str
        Where its nonlinear unknowns stand, in words, if the readings do not show it.
    """

    columns: EffectColumns
    candidate: Candidate
    trial: int
    amplitudes: Array
    own: bool
    stands: str = ""

    @property
    def effect(self) -> Effect:
        """The effect itself."""
        return self.columns.effect

    @property
    def now(self) -> Array:
        """Columns (k, R) of the readings there are."""
        return np.asarray(self.candidate.columns[self.trial])

    @property
    def signature(self) -> Array:
        """Whitened displacement (R,) of the readings there are."""
        return np.asarray(self.amplitudes @ self.now)


class OldAndNew:
    """Old readings and blocks of new ones over one list of unknowns.

    Unknowns in order: those of the fit (geometry, effects in it, old frames), what every run has
    for itself of the effects in it, the new frame; then the rival's.
    """

    def __init__(self, fit: Fit, follow: FollowUp) -> None:
        self.fit, self.follow = fit, follow
        model = fit.model
        self.own = [own_to_each_run(effect, model.rows) for effect in model.effects]
        new = [
            [u.prior_sigma for u in effect.unknowns(follow.rows) if not u.nonlinear]
            for effect, own in zip(model.effects, self.own, strict=True)
            if own
        ]
        sigmas = np.array([sigma for group in new for sigma in group])
        self.precision = np.concatenate(
            [fit.prior_precision, 1.0 / sigmas**2, np.zeros(follow.frame.shape[0])]
        )

    def old(self) -> Array:
        """Columns (n, R) of the readings there are."""
        extra = self.precision.size - self.fit.prior_precision.size
        return np.concatenate([self.fit.jacobian, np.zeros((extra, self.fit.jacobian.shape[1]))])

    def new(self, rows: Rows) -> Array:
        """Columns (n, 3, N) of the follow-up, for the way that ``rows`` came."""
        follow, model = self.follow, self.fit.model
        shape = follow.geometry.shape[1:]
        parts, apart = [follow.geometry], []
        for effect, own, values, group in zip(
            model.effects, self.own, self.fit.linear.state.effects, model.unknowns, strict=True
        ):
            kept = np.zeros((len(group), *shape))
            linear = linear_among(group)
            if own:
                count = len(effect.unknowns(follow.rows))
                apart.append(follow.columns(effect, np.zeros(count), rows))
            else:
                kept[linear] = follow.columns(effect, values, rows)
            parts.append(kept)
        parts.append(np.zeros((len(model.setup.unknowns) + 6 * model.frames, *shape)))
        return np.concatenate([*parts, *apart, follow.frame])


def effect_columns_then(side: Side, follow: FollowUp, rows: Rows) -> tuple[Array, Array]:
    """Columns (k, 3, N) of an effect in the follow-up, and its displacement (3, N)."""
    values = at_trial(side.columns.unknowns, side.columns.trials[side.trial])
    count = len(side.effect.unknowns(follow.rows))
    if side.own and values.size != count:
        values = values[:count]
    columns = follow.columns(side.effect, values, rows)
    amplitudes = side.amplitudes
    if amplitudes.size != columns.shape[0]:
        amplitudes = amplitudes.reshape(-1, columns.shape[0]).mean(axis=0)
    return columns, np.tensordot(amplitudes, columns, axes=1)


def rival_of(sides: Sequence[Side], side: Side) -> Side | None:
    """Name the other side; None where the question is whether one effect is there at all."""
    return next((other for other in sides if other is not side), None)


def _precision(together: OldAndNew, rival: Side | None) -> Array:
    if rival is None:
        return together.precision
    own = rival.candidate.prior_precision
    return np.concatenate([together.precision, own, own if rival.own else own[:0]])


def _with_rival(shared: Array, rival: Side | None, now: bool, columns: Array | None) -> Array:
    """Columns with the rival's behind; a drift has unknowns of its own in each run."""
    if rival is None or columns is None:
        return shared
    none = np.zeros_like(columns)
    if not rival.own:
        return np.concatenate([shared, columns])
    return np.concatenate([shared, columns, none] if now else [shared, none, columns])


def separation(side: Side, rival: Side | None, together: OldAndNew, rows: Rows) -> Separation:
    """Readings that there are, and the base nests of the follow-up, which are always read."""
    follow = together.follow
    old = _with_rival(together.old(), rival, True, None if rival is None else rival.now)
    base = _with_rival(together.new(rows), rival, False, _then(rival, follow, rows))
    signature = effect_columns_then(side, follow, rows)[1]
    return Separation(
        np.concatenate([old, follow.of_base(base)], axis=1),
        _precision(together, rival),
        np.concatenate([side.signature, follow.of_base(signature[None])[0]]),
    )


def _then(rival: Side | None, follow: FollowUp, rows: Rows) -> Array | None:
    if rival is None:
        return None
    return matched(rival, effect_columns_then(rival, follow, rows)[0])


def matched(side: Side, columns: Array) -> Array:
    """Columns of one run's own unknowns, padded to as many as the old runs have together."""
    if columns.shape[0] == side.amplitudes.size:
        return columns
    padded = np.zeros((side.amplitudes.size, *columns.shape[1:]))
    padded[: columns.shape[0]] = columns
    return padded


def blocks_of_side(
    side: Side, rival: Side | None, together: OldAndNew, shared: Array, rows: Rows
) -> CandidateBlocks:
    """Every candidate pose as the fit of the other side sees it."""
    follow = together.follow
    nuisance = _with_rival(shared, rival, False, _then(rival, follow, rows))
    signature = effect_columns_then(side, follow, rows)[1]
    return CandidateBlocks(follow.by_pose(nuisance), follow.by_pose(signature[None])[:, 0])
