"""The next experiment: which poses, with which load or temperature, tell two effects apart.

Greedy T-optimal choice among reachable poses, in the order in which they are to be visited (the
direction of approach is that of the way there), under several conditions of the whole follow-up;
then the decision itself is rehearsed on null draws of old and new readings together.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array
from calib.discover.candidate import Candidate, Term
from calib.discover.diagnosis import Finding, diagnose
from calib.discover.family import family
from calib.discover.follow_up import FollowUp, own_to_each_run
from calib.discover.next_experiment import Blocks, Separation, choose_sequence
from calib.discover.pairs import power, prefers
from calib.discover.problem import LinearProblem
from calib.discover.run_problem import EffectColumns, effect_candidates, effect_columns, problem_of
from calib.discover.scores import score
from calib.effects.component import Effect
from calib.errors import BadInput
from calib.identify.fitting import Fit
from calib.model.prediction import at_trial
from calib.poses.reach import PoseSet, sample_poses
from calib.runs.stack import Rows

CANDIDATES = 250
DRAWS = 399
NOT_SEEN = 0.05
"""p-value above which an effect's estimate says nothing; its usual size is taken instead."""
LOADS_KG = (0.0, 10.0)
WARMER_K = 10.0


@dataclass(frozen=True, eq=False)
class Plan:
    """Poses to visit in this order, and what they will tell.

    Attributes
    ----------
    poses : PoseSet
        In the order of the visit; the direction of approach is that of the way from one to the
        next.
    conditions : dict
        Channels that are to stand at a value (payload, temperature); empty: as they were.
    before, after : dict
        Probability to tell them apart if the key is true, with the readings there are, and with
        the follow-up too. For a single effect: the power to see it.
    """

    poses: PoseSet
    conditions: dict[str, float]
    before: dict[str, float]
    after: dict[str, float]

    @property
    def certainty(self) -> float:
        """The smallest probability of success."""
        return min(self.after.values())


@dataclass(frozen=True, eq=False)
class _Side:
    """One effect that may be the truth: its columns now, best trial and amplitudes."""

    columns: EffectColumns
    candidate: Candidate
    trial: int
    amplitudes: Array
    own: bool

    @property
    def effect(self) -> Effect:
        return self.columns.effect

    @property
    def now(self) -> Array:
        """Columns (k, R) of the readings there are."""
        return np.asarray(self.candidate.columns[self.trial])

    @property
    def signature(self) -> Array:
        return np.asarray(self.amplitudes @ self.now)


def design_follow_up(
    fit: Fit,
    effects: Sequence[Effect],
    count: int,
    rng: np.random.Generator,
    *,
    candidates: int = CANDIDATES,
    conditions: Sequence[Mapping[str, float]] | None = None,
    watch: Callable[[str], None] | None = None,
) -> Plan:
    """Choose ``count`` poses that tell two effects apart, or show one.

    Parameters
    ----------
    fit : Fit
        The model without the effects in question.
    effects : one or two of Effect
    count : int
    rng : numpy Generator
    candidates : int
        Reachable poses among which to choose.
    conditions : sequence of mappings, optional
        Values of channels under which the whole follow-up could be measured; default: as it was,
        and with loads and temperatures that the effects depend on.
    watch : callable, optional
        Told about progress.

    Raises
    ------
    BadInput
        If an effect cannot be seen in these runs at all or is in the model already.
    """
    sides = _sides(fit, effects, rng)
    poses = sample_poses(fit.model.machine, candidates, rng)
    before = _chances(problem_of(fit), [side.candidate for side in sides], sides, rng)
    best: Plan | None = None
    for condition in conditions or default_conditions(fit, effects):
        if watch is not None:
            watch(", ".join(f"{k} = {v:g}" for k, v in condition.items()) or "as it was")
        plan = _planned(fit, sides, poses, count, condition, before, rng)
        if best is None or plan.certainty > best.certainty + 0.02:
            best = plan
    assert best is not None
    return best


def default_conditions(fit: Fit, effects: Sequence[Effect]) -> list[dict[str, float]]:
    """As it was; and where an effect depends on them, other loads and a warmer structure."""
    rows = fit.model.rows
    needed = {name for effect in effects for name in (*effect.channels, *effect.depends)}
    found: list[dict[str, float]] = [{}]
    if "payload_kg" in needed and "payload_kg" in rows.channels:
        seen = rows.channels["payload_kg"]
        levels = {float(np.nanmin(seen)), float(np.nanmax(seen)), *LOADS_KG}
        found += [{"payload_kg": level} for level in sorted(levels)]
    if "structure_temp_C" in needed and "structure_temp_C" in rows.channels:
        last = float(np.nanmean(rows.channels["structure_temp_C"]))
        found.append({"structure_temp_C": round(last + WARMER_K, 1)})
    return found


def _sides(fit: Fit, effects: Sequence[Effect], rng: np.random.Generator) -> list[_Side]:
    """Every effect with its size: as estimated where it is seen, else as large as is usual."""
    held = [effect.id for effect in fit.model.effects]
    rows = fit.model.rows
    for effect in effects:
        if effect.id in held:
            raise BadInput(f"{effect.id} is in the model already", remedy="Leave it out of --add")
        if reason := effect.unavailable(rows):
            raise BadInput(f"{effect.id} cannot be told from anything here: {reason}")
    columns = effect_columns(fit, effects)
    problem = problem_of(fit)
    offered = effect_candidates(fit, problem, columns)
    found = diagnose(problem, offered, rng=rng, draws=99)
    findings = {finding.name: finding for finding in found.findings}
    return [
        _side(one, candidate, findings[candidate.name], own_to_each_run(one.effect, rows))
        for one, candidate in zip(columns, offered, strict=True)
    ]


def _side(one: EffectColumns, candidate: Candidate, found: Finding, own: bool) -> _Side:
    trial = one.trials.index(found.trial)
    amplitudes = np.array([estimate.value for estimate in found.estimates])
    if found.p_value > NOT_SEEN:
        amplitudes = candidate.sizes / np.sqrt(candidate.sizes.size)
    return _Side(one, candidate, trial, amplitudes, own)


def _chances(
    problem: LinearProblem,
    candidates: Sequence[Candidate],
    sides: Sequence[_Side],
    rng: np.random.Generator,
) -> dict[str, float]:
    """Rehearse the decision: the probability of the right answer for each truth."""
    scores = score(problem, candidates, rng, DRAWS)
    hidden = [
        side.amplitudes @ candidate.columns[min(side.trial, len(candidate.trials) - 1)]
        for side, candidate in zip(sides, candidates, strict=True)
    ]
    if len(sides) == 1:
        alone = family(scores.levels, np.ones(1))
        return {sides[0].effect.id: power(scores, alone, 0, hidden[0])}
    return {
        sides[0].effect.id: prefers(scores, 0, 1, hidden[0]),
        sides[1].effect.id: prefers(scores, 1, 0, hidden[1]),
    }


class _Together:
    """Old readings and blocks of new ones over one list of unknowns.

    Unknowns in order: those of the fit (geometry, effects in it, old frames), what every run has
    for itself of the effects in it, the new frame; then the rival's.
    """

    def __init__(self, fit: Fit, follow: FollowUp) -> None:
        self.fit, self.follow = fit, follow
        model = fit.model
        self.own = [own_to_each_run(effect, model.rows) for effect in model.effects]
        new = [
            [u.sigma or 1e3 * u.size for u in effect.unknowns(follow.rows) if not u.nonlinear]
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
            linear = np.array([not unknown.nonlinear for unknown in group])
            if own:
                count = len(effect.unknowns(follow.rows))
                apart.append(follow.columns(effect, np.zeros(count), rows))
            else:
                kept[linear] = follow.columns(effect, values, rows)
            parts.append(kept)
        parts.append(np.zeros((6 * model.frames, *shape)))
        return np.concatenate([*parts, *apart, follow.frame])


def _effect_blocks(side: _Side, follow: FollowUp, rows: Rows) -> tuple[Array, Array]:
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


def _planned(
    fit: Fit,
    sides: Sequence[_Side],
    poses: PoseSet,
    count: int,
    condition: Mapping[str, float],
    before: dict[str, float],
    rng: np.random.Generator,
) -> Plan:
    follow = FollowUp(fit, poses, condition)
    together = _Together(fit, follow)
    start = follow.approached(None)
    separations = [_separation(side, _rival(sides, side), together, start) for side in sides]

    def offer(chosen: list[int]) -> list[Blocks]:
        rows = follow.approached(poses.q[:, chosen[-1]] if chosen else None)
        shared = together.new(rows)
        return [_blocks(side, _rival(sides, side), together, shared, rows) for side in sides]

    chosen = choose_sequence(separations, offer, count)
    after = _rehearsed(sides, together, chosen, rng)
    return Plan(poses.take(np.array(chosen, dtype=np.intp)), dict(condition), before, after)


def _rival(sides: Sequence[_Side], side: _Side) -> _Side | None:
    return next((other for other in sides if other is not side), None)


def _precision(together: _Together, rival: _Side | None) -> Array:
    if rival is None:
        return together.precision
    own = rival.candidate.prior_precision
    return np.concatenate([together.precision, own, own if rival.own else own[:0]])


def _with_rival(shared: Array, rival: _Side | None, now: bool, columns: Array | None) -> Array:
    """Columns with the rival's behind; a drift has unknowns of its own in each run."""
    if rival is None or columns is None:
        return shared
    none = np.zeros_like(columns)
    if not rival.own:
        return np.concatenate([shared, columns])
    return np.concatenate([shared, columns, none] if now else [shared, none, columns])


def _separation(side: _Side, rival: _Side | None, together: _Together, rows: Rows) -> Separation:
    """Readings that there are, and the base nests of the follow-up, which are always read."""
    follow = together.follow
    old = _with_rival(together.old(), rival, True, None if rival is None else rival.now)
    columns = None if rival is None else _effect_blocks(rival, follow, rows)[0]
    base = _with_rival(together.new(rows), rival, False, _matched(rival, columns))
    signature = _effect_blocks(side, follow, rows)[1]
    return Separation(
        np.concatenate([old, follow.of_base(base)], axis=1),
        _precision(together, rival),
        np.concatenate([side.signature, follow.of_base(signature[None])[0]]),
    )


def _matched(rival: _Side | None, columns: Array | None) -> Array | None:
    """Columns of one run's own unknowns, padded to those of all old runs."""
    if rival is None or columns is None or columns.shape[0] == rival.amplitudes.size:
        return columns
    padded = np.zeros((rival.amplitudes.size, *columns.shape[1:]))
    padded[: columns.shape[0]] = columns
    return padded


def _blocks(
    side: _Side, rival: _Side | None, together: _Together, shared: Array, rows: Rows
) -> Blocks:
    follow = together.follow
    columns = None if rival is None else _effect_blocks(rival, follow, rows)[0]
    nuisance = _with_rival(shared, rival, False, _matched(rival, columns))
    signature = _effect_blocks(side, follow, rows)[1]
    return Blocks(follow.by_pose(nuisance), follow.by_pose(signature[None])[:, 0])


def _rehearsed(
    sides: Sequence[_Side], together: _Together, chosen: list[int], rng: np.random.Generator
) -> dict[str, float]:
    """Probabilities of success with old and new readings in one fit."""
    follow = together.follow
    start = follow.approached(None)
    jacobian = [together.old(), follow.of_base(together.new(start))]
    parts: list[list[Array]] = []
    for side in sides:
        base = _matched(side, _effect_blocks(side, follow, start)[0])
        assert base is not None
        parts.append([side.now, follow.of_base(base)])
    origin: Array | None = None
    for index in chosen:
        rows = follow.approached(origin)
        jacobian.append(follow.by_pose(together.new(rows))[index])
        for side, blocks in zip(sides, parts, strict=True):
            here = _matched(side, _effect_blocks(side, follow, rows)[0])
            assert here is not None
            blocks.append(follow.by_pose(here)[index])
        origin = follow.poses.q[:, index]
    whole = np.concatenate(jacobian, axis=1)
    problem = LinearProblem(np.zeros(whole.shape[1]), whole, together.precision)
    candidates = [
        _candidate(side, np.concatenate(blocks, axis=1))
        for side, blocks in zip(sides, parts, strict=True)
    ]
    return _chances(problem, candidates, sides, rng)


def _candidate(side: _Side, columns: Array) -> Candidate:
    terms: tuple[Term, ...] = side.candidate.terms
    return Candidate(side.candidate.name, terms, columns[None], subsets=side.candidate.subsets)
