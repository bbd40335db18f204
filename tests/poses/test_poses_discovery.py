"""Poses for discovery: what they will see is told beforehand, and is no less than without them."""

import numpy as np
import pytest

from app.files.machines import load_machine
from app.jobs.posing import PosesReport, choose_poses
from calib.discover.exploring import explore
from calib.discover.planned import foreseen, planned_fit
from calib.effects import effect_named
from calib.errors import BadInput
from calib.identify import Fit
from calib.model.prototype import nests_of
from calib.poses.reach import sample_poses
from calib.runs import Header
from calib.runs.header import Load


@pytest.fixture(scope="module")
def chosen() -> PosesReport:
    return choose_poses("ptm", 18, candidates=200, purpose="discovery")


def test_all_poses_are_there_and_a_plan_for_accuracy_says_nothing_of_effects(chosen):
    plain = choose_poses("ptm", 12, candidates=100)
    assert len({pose.label for pose in chosen.poses}) == 18
    assert (chosen.purpose, plain.purpose) == ("discovery", "accuracy")
    assert plain.will_see == ()
    assert chosen.predicted.position_rms_um > 0.0


def test_what_is_seen_is_told_of_every_effect_that_can_be_asked(chosen):
    names = {one.effect for one in chosen.will_see}
    assert {"backlash", "thermal-growth", "screw-cyclic", "creep"} <= names
    assert not names & set(chosen.not_asked)
    assert "[load]" in chosen.not_asked["gravity-sag"]
    powers = [one.power for one in chosen.will_see]
    assert powers == sorted(powers)
    assert sum(powers) > sum(one.by_accuracy for one in chosen.will_see) - 0.3


def test_an_encoder_that_no_pose_turns_is_said_to_stay_unseen(chosen):
    (cyclic,) = [one for one in chosen.will_see if one.effect == "screw-cyclic"]
    assert "where period = 6.28 rad" in cyclic.why
    assert "the poses take no actuator through more than 0." in cyclic.why


def test_poses_are_chosen_for_what_is_not_seen_yet():
    machine = load_machine("hexapod")
    pool = sample_poses(machine, 120, np.random.default_rng(3))
    effects = [effect_named(name, machine) for name in ("screw-pitch", "contact")]

    def fitted(which: list[int]) -> Fit:
        return planned_fit("hexapod", pool.take(np.array(which)), None, 0.005, 0.0)

    def seen(which: list[int]) -> float:
        sights = foreseen(fitted(which), effects, np.random.default_rng(1))
        return sum(one.power for one in sights)

    first = list(range(12))
    found = explore(fitted(first), effects, pool, 8, np.random.default_rng(1))
    assert len(set(found)) == 8
    at_random = [seen([*first, *range(k, k + 8)]) for k in (12, 40, 60)]
    assert seen([*first, *found]) > max(at_random)


@pytest.mark.parametrize("asked", [{"heights": True}, {"angle_mdeg": 1.0}])
def test_other_instruments_are_refused_with_a_remedy(asked):
    with pytest.raises(BadInput, match="a tracker reads"):
        choose_poses("ptm", 12, candidates=100, purpose="discovery", **asked)


def test_with_a_load_the_weight_is_in_question():
    pool = sample_poses(load_machine("hexapod"), 14, np.random.default_rng(1))
    platform, base = nests_of(pool.machine)
    down = np.array([0.0, 0.0, -9.81])
    header = Header(
        "hexapod", platform_nests=platform, base_nests=base,
        load=Load(down, 4.0, np.zeros(3), np.zeros(3)),
    )  # fmt: skip
    rows = planned_fit("hexapod", pool, header, 0.005, 8.0).model.rows
    assert not effect_named("gravity-sag", pool.machine).unavailable(rows)
    assert set(rows.channels["payload_kg"]) == {8.0}
