"""Plans: stable numbered steps, readable back, and a path that is checked as a whole."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from session_mock import POSES, site_text

from app.errors import GateRefused
from app.files.site import Site, parse_site
from app.session import kinds
from app.session.path import check_waypoints, waypoints
from app.session.plan import Plan
from app.session.plans import Order, PlanOptions, measure_plan
from calib.errors import BadInput
from calib.mechanism.description import Machine


@pytest.fixture
def site(tmp_path: Path) -> Site:
    return parse_site(site_text(smrs=3), "site.toml", tmp_path)


@pytest.mark.parametrize("order", ["nest-by-nest", "pose-by-pose"])
def test_every_pose_is_read_in_every_nest_once_a_cycle(site: Site, order: Order) -> None:
    plan = measure_plan(site, POSES, PlanOptions(order=order, cycles=2, reference_every=4))
    reads = [
        (s.args["pose"], s.args["nest"], s.args["cycle"])
        for s in plan.steps
        if s.kind is kinds.READ
    ]
    wanted = {(p, n, c) for p in POSES for n in site.platform_nests for c in (1, 2)}
    assert set(reads) == wanted
    assert len(reads) == len(wanted)
    assert len({s.id for s in plan.steps}) == len(plan.steps)
    groups = [s.args["group"] for s in plan.steps if s.kind is kinds.DRIFT]
    assert groups[0] == "start"
    assert groups[-1] == "end"
    assert len(groups) > 3


@pytest.mark.parametrize("order", ["nest-by-nest", "pose-by-pose"])
@pytest.mark.parametrize("every", [1, 4, 5])
def test_the_base_is_looked_at_after_so_many_poses(site: Site, order: Order, every: int) -> None:
    plan = measure_plan(site, POSES, PlanOptions(order=order, reference_every=every))
    moves, between = 0, []
    for step in plan.steps:
        moves += step.kind is kinds.MOVE
        if step.kind is kinds.DRIFT:
            between.append(moves)
            moves = 0
    total = len(POSES) * (1 if order == "pose-by-pose" else 3)
    whole, rest = divmod(total - 1, every)
    assert between == [0, *[every] * whole, rest + 1]


@pytest.mark.parametrize("order", ["nest-by-nest", "pose-by-pose"])
def test_every_smr_is_carried_that_there_is_and_no_other(site: Site, order: Order) -> None:
    plan = measure_plan(site, POSES, PlanOptions(order=order))
    carried = [(s.args["smr"], s.args["nest"]) for s in plan.steps if s.kind is kinds.CARRY]
    one = order == "nest-by-nest"
    assert carried == [(1 if one else k, nest) for k, nest in enumerate("345", start=1)]


def test_nothing_moves_before_the_path_is_checked(site: Site) -> None:
    order = [step.kind.name for step in measure_plan(site, POSES, PlanOptions()).steps]
    moving = [order.index(kind) for kind in ("home", "move", "drives")]
    assert order.index("connect") < order.index("check-path") < min(moving)
    assert order[-1] == "rest"


def test_the_same_campaign_gives_the_same_identifiers_and_reads_back(site: Site) -> None:
    plan = measure_plan(site, POSES, PlanOptions())
    assert plan == measure_plan(site, POSES, PlanOptions())
    assert Plan.from_json(plan.to_json(), "plan.json") == plan


def test_a_file_that_is_no_plan_is_named() -> None:
    with pytest.raises(BadInput, match=r"plan\.json"):
        Plan.from_json('{"format": "another"}', "plan.json")


def test_pose_by_pose_needs_an_smr_in_each_nest(tmp_path: Path) -> None:
    site = parse_site(site_text(smrs=1), "site.toml", tmp_path)
    with pytest.raises(BadInput, match="the site has 1"):
        measure_plan(site, POSES, PlanOptions(order="pose-by-pose"))


def test_waypoints_are_the_poses_in_order_without_standing_still(site: Site) -> None:
    path = waypoints(measure_plan(site, POSES, PlanOptions(order="pose-by-pose")))
    assert path == ["home", *POSES, "home"]
    assert all(a != b for a, b in pairwise(path))


def test_a_pose_beyond_the_strokes_is_refused(site: Site) -> None:
    machine = site.machine
    poses = [machine.home, (0.0, 0.0, 205.0, 0.0, 0.0, 0.30)]
    least = check_waypoints(machine, {}, poses, ["home", "low"])
    assert least > 0.0
    with pytest.raises(GateRefused) as refused:
        check_waypoints(machine, {}, [*poses, (0.0, 0.0, 290.0, 0.0, 0.0, 0.0)], list("hlx"))
    assert "pose x" in refused.value.what
    assert "q" in refused.value.what
    assert "nothing has moved" in refused.value.remedy


def guarded(machine: Machine, limb: str, joint: str, low: float) -> Machine:
    """The same machine, one passive joint of which must not turn below ``low``, rad."""
    limbs = [
        replace(
            each,
            joints=tuple(
                replace(j, limits=(low, np.inf)) if (each.name, j.name) == (limb, joint) else j
                for j in each.joints
            ),
        )
        for each in machine.limbs
    ]
    return replace(machine, limbs=tuple(limbs))


def test_a_way_between_two_good_poses_that_passes_a_joints_limit_is_refused(site: Site) -> None:
    """Turned the other way round and back, the platform bends this joint least on the way."""
    there, back = (0.0, 0.0, 215.0, 0.0, 0.2, 0.2), (0.0, 0.0, 215.0, 0.0, -0.2, -0.2)
    at_the_ends, on_the_way = 0.3538, 0.3258
    low = 0.5 * (at_the_ends + on_the_way)
    machine = guarded(site.machine, "leg3", "swing_B", low)
    for pose in (there, back):
        assert check_waypoints(machine, {}, [pose], ["alone"]) > 0.0
    assert check_waypoints(site.machine, {}, [there, back], ["a", "b"]) > 0.0
    with pytest.raises(GateRefused, match=r"way from pose a to pose b .*leg3\.swing_B") as refused:
        check_waypoints(machine, {}, [there, back], ["a", "b"])
    assert "nothing has moved" in refused.value.remedy


def test_the_controllers_own_parameters_decide_on_limits(site: Site) -> None:
    pose = (0.0, 0.0, 252.0, 0.0, 0.0, 0.0)
    path = [site.machine.home, pose]
    least = check_waypoints(site.machine, {}, path, ["home", "high"])
    assert 0.0 < least < 5.0
    longer = {f"leg{i}.B_z": -10.0 for i in range(1, 7)}
    with pytest.raises(GateRefused, match="q1"):
        check_waypoints(site.machine, longer, path, ["home", "high"])
    assert np.isfinite(least)
