import json

import numpy as np
import pytest
from click.testing import CliRunner

from app.files.machines import load_machine, shipped_machines
from app.verbs.identifiability import command
from calib.analysis.benefit import options
from calib.analysis.coverage import workspace_poses
from calib.analysis.gauge import gauges
from calib.analysis.identifiability import Identifiability, identifiability
from calib.analysis.observation import Sights, judge, observe
from calib.analysis.subsets import compare_subsets, matching
from calib.errors import BadInput
from calib.mechanism.variants import with_closure
from calib.poses.readings import HAN_2020, PoseNoise

NESTS = np.array([[0.0, 100.0, 0.0], [86.6, -50.0, 0.0], [-86.6, -50.0, 0.0]]).T
BASE = np.array([[260.0, 0.0, -30.0], [-130.0, 225.0, -30.0], [-130.0, -225.0, -30.0]]).T
WHOLE = Sights(np.zeros((3, 0)), pose_noise=HAN_2020)
ESSENTIAL = [
    *(f"limb[1234].{name}" for name in (
        "0da1", "0dg1", "4da5", "6da5", "6dg5", "0dx1", "0dz1", "1dx2", "1dy2", "4dz5", "6dx5",
        "6dz5",
    )),
    *(f"limb5.{name}" for name in ("0dz1", "1dx2", "3dz4", "4dx5", "6dz5")),
]  # fmt: skip
"""Zhang et al. 2018, section 4: the essential errors beside the two home positions."""


def hexapod(**how: bool) -> Identifiability:
    machine = load_machine("hexapod")
    poses = workspace_poses(machine, 60, np.random.default_rng(1))
    return identifiability(observe(poses, Sights(NESTS, **how)))


@pytest.mark.parametrize(
    ("frame_free", "nests_free", "rank", "unknowns"),
    [(False, False, 54, 54), (True, False, 57, 60), (False, True, 60, 63), (True, True, 63, 69)],
)
def test_hexapod_ranks(frame_free: bool, nests_free: bool, rank: int, unknowns: int) -> None:
    found = hexapod(frame_free=frame_free, nests_free=nests_free)
    assert (found.rank, len(found.names)) == (rank, unknowns)
    assert len(found.base) == rank
    assert len(found.relations) == unknowns - rank


def test_the_weakest_kept_combination_is_far_above_rounding() -> None:
    found = hexapod(frame_free=True)
    s = found.singular_values
    assert found.smallest_kept > 1e-7
    assert s[found.rank] / s[0] < 1e-14


def test_relations_say_what_looks_alike() -> None:
    machine = load_machine("ptm")
    poses = workspace_poses(machine, 1, np.random.default_rng(0))
    observation = observe(poses, WHOLE)
    found = identifiability(observation)
    column = dict(zip(found.names, (observation.A / observation.scale).T, strict=True))
    for relation in found.relations:
        expected = sum(factor * column[other] for other, factor in relation.like)
        size = np.linalg.norm(column[relation.name])
        assert np.linalg.norm(column[relation.name] - expected) < 1e-6 * max(size, 1e-9)
    # docs/papers.md: dtheta_i = L (cos theta_L 1dx2 + sin theta_L 1dy2), exactly.
    group = next(g for g in found.exact_groups if "limb1.dtheta" in g)
    assert set(group) == {"limb1.dtheta", "limb1.1dx2", "limb1.1dy2"}


@pytest.mark.parametrize(
    ("closure", "rank", "of_53"), [("", 55, 39), ("LS", 55, 39), ("D3", 46, 33)]
)
def test_ptm_ranks_and_its_53_essential_errors(closure: str, rank: int, of_53: int) -> None:
    machine = load_machine("ptm")
    machine = with_closure(machine, closure) if closure else machine
    poses = workspace_poses(machine, 1, np.random.default_rng(0))
    observation = observe(poses, WHOLE)
    found = identifiability(observation)
    assert found.rank == rank
    assert found.singular_values[rank] / found.singular_values[0] < 1e-14
    named = matching(found.names, ESSENTIAL)
    assert len(named) == 53
    assert identifiability(observation.only(named)).rank == of_53


def test_sensitivity_is_not_identifiability() -> None:
    # 50 poses, 10 um and 0.004 deg: everything, or a base set, to 0.015 mm; the 53 far worse.
    machine = load_machine("ptm")
    grid = workspace_poses(machine, 1, np.random.default_rng(0))
    some = grid.take(np.random.default_rng(1).choice(grid.count, 50, replace=False))
    noise = PoseNoise(0.010, float(np.deg2rad(0.004)))
    observation = observe(some, Sights(np.zeros((3, 0)), pose_noise=noise))
    found = identifiability(observation)
    named = matching(found.names, ESSENTIAL)
    nothing, every, base, strongest, chosen, _ = compare_subsets(
        observation, judge(grid, observation), found.base, named
    )
    assert 400.0 < nothing.position_um < 700.0
    assert every.position_um <= 15.0
    assert base.position_um <= 15.0
    assert base.orientation_mdeg <= 6.0
    assert (chosen.count, chosen.rank) == (53, 39)
    assert chosen.position_um > 5.0 * base.position_um
    assert strongest.rank < strongest.count == 55
    assert strongest.position_um > 5.0 * base.position_um


def test_prediction_for_a_subset_is_what_simulated_fits_show() -> None:
    machine = load_machine("stewart")
    poses = workspace_poses(machine, 20, np.random.default_rng(2))
    observation = observe(poses, Sights(NESTS))
    judged = judge(poses, observation)
    held = matching(observation.names, ["leg[1234].*"])
    found = compare_subsets(observation, judged, (), held)[-2]
    generator = np.random.default_rng(3)
    truth = generator.standard_normal((len(observation.names), 1500))
    seen = observation.A @ truth + generator.standard_normal((len(observation.A), 1500))
    estimate = np.zeros_like(truth)
    estimate[held] = np.linalg.lstsq(observation.A[:, held], seen, rcond=None)[0]
    error = estimate - truth
    actual = np.sqrt(np.mean(np.einsum("pk,pq,qk->k", error, judged.position, error))) * 1e3
    assert found.position_um == pytest.approx(actual, rel=0.05)


@pytest.mark.parametrize(
    ("name", "exact", "weak"),
    [("hexapod", 6, 6), ("hexapod-universal", 12, 0), ("stewart", 12, 0), ("ptm", 12, 0)],
)
def test_gauge_freedoms(name: str, exact: int, weak: int) -> None:
    machine = load_machine(name)
    found = gauges(workspace_poses(machine, 60, np.random.default_rng(1)), 100.0)
    assert (found.exact, found.weak) == (exact, weak)


def test_a_translational_machine_cannot_tell_tool_offset_from_frame_origin() -> None:
    found = gauges(workspace_poses(load_machine("tripod"), 40, np.random.default_rng(1)), 100.0)
    assert ("base along x", "platform along x") in found.alike
    assert found.exact >= 3


def test_tripod_ranks_with_positions_only() -> None:
    # docs/papers.md: 9 of 9; the base frame's yaw is a common theta, so 14 of 15.
    machine = load_machine("tripod")
    poses = workspace_poses(machine, 60, np.random.default_rng(1))
    point = PoseNoise(0.01, None)
    known = identifiability(observe(poses, Sights(np.zeros((3, 0)), pose_noise=point)))
    free = Sights(np.zeros((3, 0)), frame_free=True, pose_noise=point)
    found = identifiability(observe(poses, free))
    assert (known.rank, found.rank, len(found.names)) == (9, 14, 15)
    group = next(g for g in found.exact_groups if "frame.rz" in g)
    assert {"limb1.theta", "limb2.theta", "limb3.theta"} <= set(group)


@pytest.mark.parametrize("name", shipped_machines())
def test_uncertainty_never_exceeds_the_prior(name: str) -> None:
    machine = load_machine(name)
    poses = workspace_poses(machine, 30, np.random.default_rng(6))
    found = identifiability(observe(poses, Sights(NESTS)))
    assert np.all(found.sigma_ratio <= 1.0 + 1e-9)
    assert found.rank <= len(machine.parameters)


def test_more_readings_never_hurt() -> None:
    machine = load_machine("hexapod")
    generator = np.random.default_rng(8)
    poses = workspace_poses(machine, 40, generator)
    fresh = workspace_poses(machine, 60, generator)
    sights = Sights(NESTS, base=BASE, frame_free=True)
    found = {o.says: o for o in options(machine, poses, fresh, sights, generator)}
    asked = found["as asked"]
    one, two = found["1 platform nest only"], found["2 platform nests only"]
    assert one.position_um > two.position_um > asked.position_um
    assert asked.position_um > found["4 platform nests"].position_um
    assert found["half the strokes"].position_um > asked.position_um
    assert asked.position_um > found["strokes 25 % wider"].position_um
    assert found["no base nests"].rank == 57
    assert found["base frame known exactly"].unknowns == 54


def test_a_pattern_without_a_parameter_is_named() -> None:
    with pytest.raises(BadInput, match=r"leg9\.\*"):
        matching(["leg1.L0"], ["leg9.*"])


@pytest.mark.long
def test_the_verb_answers_in_words_and_json() -> None:
    runner = CliRunner()
    words = runner.invoke(command, ["hexapod", "--no-base-nests"])
    assert words.exit_code == 0, words.output
    assert "57 independent combinations of 60 unknowns" in words.stdout
    assert "12 of 12 rigid motions, 6 exactly and 6 in practice" in words.stdout
    result = runner.invoke(
        command, ["tripod", "--read", "positions", "--only", "*.theta", "--json"]
    )
    answer = json.loads(result.stdout)
    assert answer["rank"] == 15
    assert answer["subsets"][-1]["count"] == 3 + 6
