import numpy as np
import pytest

from app.files.machines import load_machine
from calib.mechanism.description import Machine
from calib.mechanism.jacobian import pose_jacobians
from calib.mechanism.limits import within_limits
from calib.mechanism.rigid import pose_difference
from calib.mechanism.solve import forward
from calib.poses import PoseSet, sample_poses
from calib.poses.choose import Candidates, Criterion, exchange, greedy
from calib.poses.design import design_poses
from calib.poses.information import Judge, covariance, prior, whitened_rows
from calib.poses.readings import HAN_2020, NestReadings, Readings

NESTS = np.array([[0.0, 100.0, 0.0], [86.6, -50.0, 0.0], [-86.6, -50.0, 0.0]]).T
BASE = np.array([[260.0, 0.0, -30.0], [-130.0, 225.0, -30.0], [-130.0, -225.0, -30.0]]).T
SIGHTS = NestReadings(NESTS, 0.005, BASE)


@pytest.fixture(scope="module")
def machine() -> Machine:
    return load_machine("hexapod")


@pytest.fixture(scope="module")
def pool(machine: Machine) -> PoseSet:
    return sample_poses(machine, 400, np.random.default_rng(7))


def problem(
    pool: PoseSet, readings: Readings, criterion: Criterion, *, priors: bool = True
) -> Candidates:
    known = prior(pool, readings, priors=priors)
    rows = whitened_rows(pool, readings, known.scale)
    weight = Judge.over(pool, readings, known.scale).weight(50.0)
    return Candidates(rows, known.information, weight, criterion)


def test_samples_are_reachable_and_repeat_with_the_seed(machine: Machine) -> None:
    first = sample_poses(machine, 300, np.random.default_rng(3))
    again = sample_poses(machine, 300, np.random.default_rng(3))
    assert np.array_equal(first.task, again.task)
    assert np.all(within_limits(machine, first.configuration))
    assert first.count == 300


@pytest.mark.parametrize("readings", [HAN_2020, SIGHTS], ids=["poses", "nests"])
@pytest.mark.parametrize("criterion", ["I", "D"])
def test_gain_is_what_adding_gains(pool: PoseSet, readings: Readings, criterion: Criterion) -> None:
    candidates = problem(pool, readings, criterion)
    greedy(candidates, 12, spread_first=False)
    gain = candidates.gains()[200]
    before = candidates.information.copy()
    candidates.add(200)
    if criterion == "I":
        after = covariance(candidates.information)
        actual = np.sum((covariance(before) - after) * candidates.weight)
    else:
        actual = np.linalg.slogdet(candidates.information)[1] - np.linalg.slogdet(before)[1]
    assert gain == pytest.approx(actual, rel=1e-6)


@pytest.mark.parametrize("priors", [True, False])
def test_updates_agree_with_starting_anew(pool: PoseSet, priors: bool) -> None:
    candidates = problem(pool, SIGHTS, "I", priors=priors)
    greedy(candidates, 25, spread_first=not priors)
    exchange(candidates, 9)
    error, gains = np.sum(candidates.C * candidates.weight), candidates.gains()
    candidates.refresh()
    assert error == pytest.approx(np.sum(candidates.C * candidates.weight), rel=1e-4)
    free = np.isfinite(gains)
    assert gains[free] == pytest.approx(candidates.gains()[free], rel=1e-4)


@pytest.mark.parametrize("criterion", ["I", "D"])
def test_no_single_exchange_is_left_that_helps(pool: PoseSet, criterion: Criterion) -> None:
    few = pool.take(slice(0, 60))
    candidates = problem(few, HAN_2020, criterion)
    greedy(candidates, 12, spread_first=False)
    exchange(candidates, 500)

    def score(chosen: list[int]) -> float:
        information = candidates.base.copy()
        for k in chosen:
            information += candidates.rows[:, :, k] @ candidates.rows[:, :, k].T
        if criterion == "D":
            return float(-np.linalg.slogdet(information)[1])
        return float(np.sum(covariance(information) * candidates.weight))

    best = score(candidates.chosen)
    for out in candidates.chosen:
        rest = [k for k in candidates.chosen if k != out]
        for new in range(0, few.count, 3):
            if new not in candidates.chosen:
                assert score([*rest, new]) > best - 1e-9 * abs(best)


def test_random_poses_give_what_the_notes_say(machine: Machine) -> None:
    # Position RMS on fresh poses, paper noise, no priors: 12.6 um from 29, 3.4 um from 256.
    generator = np.random.default_rng(11)
    fresh = sample_poses(machine, 500, generator)
    for count, draws, expected, within in ((29, 12, 12.6, 1.2), (256, 3, 3.4, 0.3)):
        found = []
        for _ in range(draws):
            some = sample_poses(machine, count, generator)
            known = prior(some, HAN_2020, priors=False)
            rows = whitened_rows(some, HAN_2020, known.scale).reshape(54, -1)
            C = covariance(known.information + rows @ rows.T)
            judge = Judge.over(fresh, HAN_2020, known.scale)
            found.append(judge.accuracy(C).position_um)
        assert np.median(found) == pytest.approx(expected, abs=within)


@pytest.mark.long
@pytest.mark.parametrize(
    ("criterion", "priors", "wanted"), [("I", True, 7.0), ("I", False, 7.6), ("D", False, 8.1)]
)
def test_29_designed_poses_reach_the_wanted_accuracy(
    machine: Machine, criterion: Criterion, priors: bool, wanted: float
) -> None:
    generator = np.random.default_rng(20)
    design = design_poses(
        machine, HAN_2020, 29, generator, criterion=criterion, priors=priors, counts=()
    )
    assert design.accuracy.position_um <= wanted
    assert design.random.position_um > 1.2 * design.accuracy.position_um
    assert np.all(within_limits(machine, design.pose_set.configuration))


def test_more_poses_predict_smaller_errors(machine: Machine) -> None:
    design = design_poses(
        machine, SIGHTS, 12, np.random.default_rng(2), candidates=300, counts=range(10, 31, 5)
    )
    errors = [accuracy.position_um for _, accuracy in design.by_count]
    assert [n for n, _ in design.by_count] == [10, 15, 20, 25, 30]
    assert errors == sorted(errors, reverse=True)


def test_prediction_is_what_simulated_fits_show(pool: PoseSet) -> None:
    # Truth anew from the prior in each trial, readings with noise, Bayes' linear fit.
    generator = np.random.default_rng(5)
    known = prior(pool, SIGHTS, priors=True)
    rows = whitened_rows(pool.take(slice(0, 20)), SIGHTS, known.scale)
    A = rows.reshape(rows.shape[0], -1).T
    C = covariance(known.information + A.T @ A)
    root = np.linalg.cholesky(covariance(known.information))
    truth = root @ generator.standard_normal((len(root), 2000))
    seen = A @ truth + generator.standard_normal((len(A), 2000))
    error = C @ (A.T @ seen) - truth
    judge = Judge.over(pool, SIGHTS, known.scale)
    actual = np.sqrt(np.mean(np.einsum("pk,pq,qk->k", error, judge.position, error))) * 1e3
    assert judge.accuracy(C).position_um == pytest.approx(actual, rel=0.02)


@pytest.mark.long
def test_prediction_holds_for_the_exact_machine(machine: Machine) -> None:
    # Truth from the priors, whole poses read with Han's noise, damped by the priors, exact
    # kinematics throughout: position RMS at fresh poses against what the design predicted.
    generator = np.random.default_rng(30)
    design = design_poses(machine, HAN_2020, 29, generator, candidates=800, counts=())
    fresh = sample_poses(machine, 100, generator)
    s, s_fresh = design.pose_set.configuration.extension, fresh.configuration.extension
    sigma = np.array([HAN_2020.position_sigma] * 3 + [HAN_2020.angle_sigma or 1.0] * 3)
    squares = []
    for _ in range(12):
        truth = machine.nominal + machine.prior_sigma * generator.standard_normal(54)
        noise = sigma[:, None] * generator.uniform(-np.sqrt(3.0), np.sqrt(3.0), (6, 29))
        seen = forward(machine, s, truth).poses
        found = machine.nominal.copy()
        for _ in range(4):
            at = forward(machine, s, found)
            J = pose_jacobians(machine, at, found).parameters / sigma[:, None]
            A = (J * machine.prior_sigma[:, None, None]).reshape(54, -1)
            r = (pose_difference(at.poses, seen) + noise) / sigma[:, None]
            pull = (machine.nominal - found) / machine.prior_sigma
            step = np.linalg.solve(A @ A.T + np.eye(54), A @ r.reshape(-1) + pull)
            found += machine.prior_sigma * step
        off = (
            forward(machine, s_fresh, found).poses.position
            - forward(machine, s_fresh, truth).poses.position
        )
        squares.append(np.mean(np.sum(off**2, axis=0)))
    actual = np.sqrt(np.mean(squares)) * 1e3
    assert actual == pytest.approx(design.accuracy.position_um, rel=0.2)
