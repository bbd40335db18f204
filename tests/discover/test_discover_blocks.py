"""Statistics in blocks are those of everything at once: columns, draws, halves, rounds."""

import numpy as np
import pytest
from discover_synthetic import POSES, Lab

from calib.evidence import Columns, LinearProblem, columns, diagnose, draws
from calib.evidence.candidate import Candidate
from calib.evidence.draws import residuals_of
from calib.evidence.halves import all_joined, halves_of
from calib.evidence.rounds import joining
from calib.evidence.scores import score


@pytest.fixture
def crowded(monkeypatch):
    """No room: no columns are held, one trial is a block, few draws and rows are made at once."""
    monkeypatch.setattr(columns, "HELD", 0)
    monkeypatch.setattr(columns, "BLOCK", 1)
    monkeypatch.setattr(draws, "HELD", 0)
    monkeypatch.setattr(draws, "BLOCK", 1)
    monkeypatch.setattr(draws, "LEAST", 17)
    monkeypatch.setattr(draws, "ROWS", 1000)


def made_anew(candidate):
    """The same candidate, its columns made when they are asked for."""
    array = np.concatenate([block for _, block in candidate.columns.blocks()])
    lazy = Columns(array.shape, lambda first, last: array[first:last].copy())
    return Candidate(
        candidate.name, candidate.unknowns, lazy, candidate.trials, candidate.subsets,
        candidate.channel, candidate.between,
    )  # fmt: skip


def asked(seed):
    """What a diagnosis says of readings with play and a warm frame in them."""
    lab = Lab(seed)
    shape = 2.5 * lab.effects[lab.index("backlash")].columns[0][0]
    shape = shape + 3.0 * lab.effects[lab.index("heat")].columns[0][0]
    problem = lab.fitted(shape, np.random.default_rng(seed))
    effects = [made_anew(one) for one in lab.effects]
    return diagnose(problem, effects, lab.structure, lab.quadratic, rng=np.random.default_rng(7))


def numbers(found):
    """All that a diagnosis has found, as numbers."""
    return np.array(
        [
            value
            for one in found.findings
            for value in (one.log_p, one.log_evidence, one.chi2_fall, one.visible)
        ]
        + [found.unexplained.log_p, found.scatter, *found.quadratic_log_p]
    )


@pytest.mark.parametrize("seed", range(4))
def test_a_diagnosis_does_not_depend_on_how_much_is_held(seed, request):
    whole = asked(seed)
    request.getfixturevalue("crowded")
    pieces = asked(seed)
    assert pieces.explained_by == whole.explained_by
    assert pieces.indistinguishable == whole.indistinguishable
    assert numbers(pieces) == pytest.approx(numbers(whole), rel=1e-7, abs=1e-9)


def test_draws_are_the_same_numbers_in_parts(request):
    lab = Lab(3)
    problem = lab.fitted(np.zeros(2 * POSES), np.random.default_rng(3))
    one, other = np.random.default_rng(5), np.random.default_rng(5)
    whole = residuals_of(problem, 60, one).array()
    request.getfixturevalue("crowded")
    parts = residuals_of(problem, 60, other)
    assert parts.array() == pytest.approx(whole, abs=1e-11)
    assert one.random() == other.random()
    again = residuals_of(problem, 40, other)
    both = parts.joined(again)
    assert both.array() == pytest.approx(np.hstack([whole, again.array()[:, 1:]]), abs=1e-11)
    rows = np.random.default_rng(8).normal(size=(2, 2 * POSES))
    assert both.times(rows) == pytest.approx(rows @ both.array(), abs=1e-10)
    pulls = np.random.default_rng(9).normal(size=(2, both.count))
    left = both.without(rows, pulls).array()
    assert left == pytest.approx(both.array() - rows.T @ pulls, abs=1e-10)


def test_a_half_in_step_with_others_is_the_fit_to_its_readings():
    lab = Lab(11)
    rng = np.random.default_rng(11)
    problem = lab.fitted(3.0 * lab.one(lab.x**3, 0), rng)
    poses = np.tile(np.arange(POSES), 2)
    always = poses < 5
    firsts = [np.isin(poses, 5 + rng.permutation(POSES - 5)[:20]) & ~always for _ in range(3)]
    halves = halves_of(problem, lab.effects, always, firsts)
    later = all_joined(halves, [joining(half, lab.index("pitch")) for half in halves])
    for half, enlarged in zip(halves, later, strict=True):
        assert np.all(half.inside[always])
        kept = half.inside
        jacobian = problem.jacobian[:, kept]
        # The optimum of this half alone, from the slope that the others leave there.
        slope = jacobian @ problem.residual[kept] - problem.jacobian @ problem.residual
        normal = jacobian @ jacobian.T + np.diag(problem.prior_precision)
        residual = problem.residual[kept] - jacobian.T @ np.linalg.solve(normal, slope)
        alone = LinearProblem(residual, jacobian, problem.prior_precision)
        own = [
            Candidate(
                one.name, one.unknowns,
                Columns.of(np.stack([one.columns[t][:, kept] for t in range(len(one.trials))])),
                one.trials, one.subsets,
            )
            for one in lab.effects
        ]  # fmt: skip
        scores = score(alone, own, rng, 0)
        assert half.trace == pytest.approx(scores.trace, rel=1e-9)
        agrees(half, scores)
        agrees(enlarged, scores.without(*joining(scores, lab.index("pitch")), rng))


def agrees(half, scores):
    """Scores and weights of a half and of the fit to its readings."""
    assert half.squares == pytest.approx(scores.squares, rel=1e-9)
    for name in ("norms", "scores", "weights"):
        for one, other in zip(getattr(half, name), getattr(scores, name), strict=True):
            assert one == pytest.approx(other, rel=1e-7, abs=1e-8)


def test_released_scores_make_anew_what_they_held():
    lab, rng = Lab(5), np.random.default_rng(5)
    problem = lab.fitted(lab.one(lab.x**3, 0), rng)
    lazy = [made_anew(one) for one in lab.effects]
    scores = score(problem, lazy, rng, 40)
    assert all(one.columns.there for one in scores.candidates)
    residuals, signature = scores.residuals.array(), joining(scores, 0)[0]
    larger = scores.without(*joining(scores, 0), np.random.default_rng(1), 0)
    scores.release()
    assert not any(one.columns.there for one in scores.candidates)
    np.testing.assert_allclose(scores.residuals.array(), residuals, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(joining(scores, 0)[0], signature)
    again = scores.without(*joining(scores, 0), np.random.default_rng(1), 0)
    for one, other in zip(larger.scores, again.scores, strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9)
