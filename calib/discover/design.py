"""The next experiment: which poses, with which load or temperature, tell two effects apart.

Greedy T-optimal choice among reachable poses, in the order in which they are to be visited (the
direction of approach is that of the way there), under several conditions of the whole follow-up;
then the decision itself is rehearsed on null draws of old and new readings together.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from calib.arrays import Array
from calib.defaults import FOLLOW_UP_FROM
from calib.discover.follow_up import FollowUp, own_to_each_run
from calib.discover.old_and_new import (
    OldAndNew,
    Side,
    blocks_of_side,
    effect_columns_then,
    matched,
    rival_of,
    separation,
)
from calib.discover.problem import effect_candidates
from calib.effects.component import Effect
from calib.errors import BadInput
from calib.evidence.candidate import Candidate
from calib.evidence.columns import Columns
from calib.evidence.diagnosis import diagnose
from calib.evidence.family import family
from calib.evidence.findings import Finding
from calib.evidence.next_experiment import CandidateBlocks, choose_sequence
from calib.evidence.pairs import power, prefers
from calib.evidence.problem import LinearProblem
from calib.evidence.scores import score
from calib.identify.fitting import Fit
from calib.identify.signatures import EffectColumns, effect_columns
from calib.poses.margin import tolerance_margin
from calib.poses.reach import PoseSet, sample_poses
from calib.unknown import searched_in_words

DRAWS = 399
NOT_SEEN = 0.05
"""p-value above which an effect's estimate says nothing; its usual size is taken instead."""
LOADS_KG = (0.0, 10.0)
WARMER_K = 10.0


@dataclass(frozen=True, eq=False)
class FollowUpPlan:
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
        the follow-up too. For a single effect: the power to see it. What the readings there are
        have left open is not better known before than they leave it, whatever was to be expected.
    at : dict
        Where what is searched of an effect that is not seen was taken to stand, in words.
    """

    poses: PoseSet
    conditions: dict[str, float]
    before: dict[str, float]
    after: dict[str, float]
    at: dict[str, str] = field(default_factory=dict)

    @property
    def certainty(self) -> float:
        """The smallest probability of success."""
        return min(self.after.values())


def design_follow_up(
    fit: Fit,
    effects: Sequence[Effect],
    count: int,
    rng: np.random.Generator,
    *,
    candidates: int = FOLLOW_UP_FROM,
    conditions: Sequence[Mapping[str, float]] | None = None,
    watch: Callable[[str], None] | None = None,
) -> FollowUpPlan:
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
    sides, surely = _sides(fit, effects, rng)
    machine = fit.model.machine
    poses = sample_poses(machine, candidates, rng, tolerance_margin(machine))
    offered = [_candidate(side, side.now) for side in sides]
    hidden = [side.signature for side in sides]
    expected = _chances(fit.problem, offered, hidden, rng)
    before = {name: min(chance, surely) for name, chance in expected.items()}
    best: FollowUpPlan | None = None
    for condition in conditions or default_conditions(fit, effects):
        if watch is not None:
            watch(", ".join(f"{k} = {v:g}" for k, v in condition.items()) or "as it was")
        plan = _planned(fit, sides, poses, count, condition, before, rng)
        if best is None or plan.certainty > best.certainty + 0.02:
            best = plan
    assert best is not None
    return replace(best, at={side.effect.id: side.stands for side in sides if side.stands})


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


def _sides(
    fit: Fit, effects: Sequence[Effect], rng: np.random.Generator
) -> tuple[list[Side], float]:
    """Every effect with its size: as estimated where it is seen, else as large as is usual.

    And how surely the readings there are tell which of two it is.
    """
    held = [effect.id for effect in fit.model.effects]
    rows = fit.model.rows
    for effect in effects:
        if effect.id in held:
            raise BadInput(f"{effect.id} is in the model already", remedy="Leave it out of --add")
        if reason := effect.unavailable(rows):
            raise BadInput(
                f"{effect.id} cannot be told from anything here: {reason}",
                remedy="Leave it out of --add",
            )
    columns = effect_columns(fit, effects)
    problem = fit.problem
    offered = effect_candidates(fit, problem, columns)
    found = diagnose(problem, offered, rng=rng, draws=99)
    findings = {finding.name: finding for finding in found.findings}
    sides = [
        _side(one, candidate, findings[candidate.name], own_to_each_run(one.effect, rows))
        for one, candidate in zip(columns, offered, strict=True)
    ]
    return sides, told_apart(found.findings)


def told_apart(findings: Sequence[Finding]) -> float:
    """Probability that the likelier of two effects is the right one, by the readings themselves.

    1 where they are no rivals: one is not seen. One half where the less likely explains as much,
    each unknown charged with two of chi-square: what sizes are usual does not decide between them.
    """
    if len(findings) < 2 or any(one.p_value > NOT_SEEN for one in findings):
        return 1.0
    first, second = sorted(findings, key=lambda one: -one.log_evidence)
    if second.chi2_fall - 2.0 * second.dof >= first.chi2_fall - 2.0 * first.dof:
        return 0.5
    return float(1.0 / (1.0 + np.exp(second.log_evidence - first.log_evidence)))


def _side(one: EffectColumns, candidate: Candidate, found: Finding, own: bool) -> Side:
    trial = one.trials.index(found.trial)
    amplitudes = np.array([estimate.value for estimate in found.estimates])
    if found.p_value <= NOT_SEEN:
        return Side(one, candidate, trial, amplitudes, own)
    amplitudes = candidate.sizes / np.sqrt(candidate.sizes.size)
    stands = searched_in_words(one.unknowns, found.trial)
    return Side(one, candidate, trial, amplitudes, own, stands)


def _chances(
    problem: LinearProblem,
    candidates: Sequence[Candidate],
    hidden: Sequence[Array],
    rng: np.random.Generator,
) -> dict[str, float]:
    """Rehearse the decision: the probability of the right answer for each truth.

    Nonlinear unknowns stay where they are now: one trial for each candidate.
    """
    scores = score(problem, candidates, rng, DRAWS)
    names = [candidate.name for candidate in candidates]
    if len(candidates) == 1:
        alone = family(scores.levels, np.ones(1))
        return {names[0]: power(scores, alone, 0, hidden[0])}
    return {
        names[0]: prefers(scores, 0, 1, hidden[0]),
        names[1]: prefers(scores, 1, 0, hidden[1]),
    }


def _planned(
    fit: Fit,
    sides: Sequence[Side],
    poses: PoseSet,
    count: int,
    condition: Mapping[str, float],
    before: dict[str, float],
    rng: np.random.Generator,
) -> FollowUpPlan:
    follow = FollowUp(fit, poses, condition)
    together = OldAndNew(fit, follow)
    start = follow.approached([])
    separations = [separation(side, rival_of(sides, side), together, start) for side in sides]

    def offer(chosen: list[int]) -> list[CandidateBlocks]:
        rows = follow.approached(chosen)
        shared = together.new(rows)
        return [
            blocks_of_side(side, rival_of(sides, side), together, shared, rows) for side in sides
        ]

    chosen = choose_sequence(separations, offer, count)
    after = _rehearsed(sides, together, chosen, rng)
    return FollowUpPlan(poses.take(np.array(chosen, dtype=np.intp)), dict(condition), before, after)


def _rehearsed(
    sides: Sequence[Side], together: OldAndNew, chosen: list[int], rng: np.random.Generator
) -> dict[str, float]:
    """Probabilities of success with old and new readings in one fit."""
    follow = together.follow
    start = follow.approached([])
    jacobian = [together.old(), follow.of_base(together.new(start))]
    then: list[list[Array]] = []
    for side in sides:
        base = matched(side, effect_columns_then(side, follow, start)[0])
        then.append([follow.of_base(base)])
    for number, index in enumerate(chosen):
        rows = follow.approached(chosen[:number])
        jacobian.append(follow.by_pose(together.new(rows))[index])
        for side, blocks in zip(sides, then, strict=True):
            here = matched(side, effect_columns_then(side, follow, rows)[0])
            blocks.append(follow.by_pose(here)[index])
    whole = np.concatenate(jacobian, axis=1)
    problem = LinearProblem(np.zeros(whole.shape[1]), whole, together.precision)
    offered = [
        _candidate(side, side.now, np.concatenate(blocks, axis=1))
        for side, blocks in zip(sides, then, strict=True)
    ]
    hidden = [_hidden(side, candidate) for side, candidate in zip(sides, offered, strict=True)]
    return _chances(problem, offered, hidden, rng)


def _candidate(side: Side, now: Array, then: Array | None = None) -> Candidate:
    """One effect at its trial over old readings, and new ones; a drift has its own in each."""
    whole = side.candidate
    if then is None:
        return Candidate(whole.name, whole.unknowns, Columns.of(now[None]), subsets=whole.subsets)
    if not side.own:
        columns = np.concatenate([now, then], axis=1)
        return Candidate(
            whole.name, whole.unknowns, Columns.of(columns[None]), subsets=whole.subsets
        )
    columns = np.block([[now, np.zeros((now.shape[0], then.shape[1]))], [np.zeros_like(now), then]])
    return Candidate(whole.name, whole.unknowns * 2, Columns.of(columns[None]))


def _hidden(side: Side, candidate: Candidate) -> Array:
    """Displacement (R,) of all readings if this effect is the truth."""
    amplitudes = np.resize(side.amplitudes, len(candidate.unknowns))
    return np.asarray(amplitudes @ candidate.columns[0])
