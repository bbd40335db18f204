"""The decisions: what is asked first, that nothing beyond the limit is, and that it ends."""

import math
from dataclasses import replace

from hypothesis import given
from hypothesis import strategies as st

from app.auto import Creep, Decision, Known, Limits, decide
from app.auto.policy import FEWEST, LONGEST_MIN, MOST, PROOF, STEADY, others

EFFECTS = st.sampled_from(["backlash", "screw-pitch", "thermal-growth", "frame-shift"])
PAIRS = st.tuples(EFFECTS, EFFECTS)
GROUNDS = st.sampled_from(["first", "unknown", "warm", "accuracy", "write", "prove", "disagree"])
UM = st.floats(0.1, 500.0)
knowns = st.builds(
    Known,
    poses=st.integers(1, 200),
    minutes=st.floats(0.0, 600.0),
    predicted_um=UM,
    falls=st.none() | st.floats(0.5, 2.0),
    ambiguous=st.lists(PAIRS, max_size=3).map(tuple),
    hopeless=st.dictionaries(PAIRS, st.just("no"), max_size=3),
    unexplained=st.booleans(),
    rounds_unknown=st.integers(0, 4),
    verified_um=st.none() | UM,
    applied=st.booleans(),
    corrections=st.integers(0, 3),
    declined=st.lists(GROUNDS, max_size=3).map(tuple),
    warmed=st.booleans(),
    creep=st.none()
    | st.builds(Creep, st.just("leg-warm-up"), st.floats(0.0, 1000.0), st.floats(2.0, 300.0)),
)
limits = st.builds(
    Limits,
    target_um=UM,
    minutes=st.just(math.inf) | st.floats(1.0, 1000.0),
    first=st.integers(6, 60),
    apply=st.booleans(),
)


@given(limits)
def test_a_first_set_is_measured_before_anything_else(wanted: Limits) -> None:
    first = decide(Known(), wanted)
    assert first == Decision("measure", "nothing was measured yet", wanted.first, ground="first")


@given(knowns, limits)
def test_no_set_is_larger_than_the_time_left(known: Known, wanted: Limits) -> None:
    decision = decide(known, wanted)
    assert decision.count <= MOST
    if decision.count:
        each = known.minutes / known.poses
        assert decision.count * each <= wanted.minutes - known.minutes or each == 0.0


def test_all_the_time_that_is_left_is_reckoned_with_not_one_set() -> None:
    wanted = Limits(8.0, minutes=360.0)
    known = Known(poses=25, minutes=50.0, predicted_um=20.0, falls=0.5)
    assert (decide(known, wanted).kind, decide(known, wanted).count) == ("measure", MOST)
    hopeless = decide(replace(known, predicted_um=37.4, falls=0.5), wanted)
    assert hopeless.kind == "stop"
    assert "155 poses for which there is time would bring 13.9 um" in hopeless.why
    assert decide(replace(known, predicted_um=37.4, falls=1.5), wanted).kind == "measure"


def test_nothing_is_given_up_by_a_fall_that_nobody_has_seen() -> None:
    wanted = Limits(8.0, minutes=360.0)
    known = Known(poses=25, minutes=50.0, predicted_um=37.4)
    assert (decide(known, wanted).kind, decide(known, wanted).count) == ("measure", 25)
    hopeless = decide(replace(known, predicted_um=800.0), wanted)
    assert (hopeless.kind, "15.4 um at best" in hopeless.why) == ("stop", True)


@given(knowns, limits)
def test_a_target_is_reached_by_fresh_poses_and_by_nothing_else(
    known: Known, wanted: Limits
) -> None:
    shown = known.verified_um is not None and known.verified_um <= wanted.target_um
    assert (decide(known, wanted).reached is True) == shown


@given(knowns, limits)
def test_nothing_is_written_that_is_in_question_or_not_good_enough(
    known: Known, wanted: Limits
) -> None:
    if decide(known, wanted).kind == "apply":
        assert wanted.apply
        assert not known.applied
        assert known.predicted_um <= wanted.target_um or "accuracy" in known.declined


@given(knowns, limits)
def test_what_the_person_has_declined_is_not_proposed_again(known: Known, wanted: Limits) -> None:
    decision = decide(known, wanted)
    assert decision.ground not in known.declined
    after = replace(known, declined=(*known.declined, decision.ground))
    assert decide(after, wanted) != decision or decision.kind in ("stop", "tell-apart")


@given(knowns, limits)
def test_what_may_be_chosen_instead_is_possible_and_another(known: Known, wanted: Limits) -> None:
    proposed = decide(known, wanted)
    found = others(known, wanted, proposed)
    said = [one.words() for one in found]
    assert len(set(said)) == len(said)
    for one in found:
        assert (one.kind, one.pair) != (proposed.kind, proposed.pair)
        assert one.ground == ""
        assert one.kind != "apply" or (wanted.apply and not known.applied)
        if one.count:
            each = known.minutes / known.poses
            assert one.count * each <= wanted.minutes - known.minutes or each == 0.0


@given(knowns, limits)
def test_what_a_gate_or_the_person_has_refused_is_the_end(known: Known, wanted: Limits) -> None:
    decision = decide(replace(known, ended="gate condition"), wanted)
    assert (decision.kind, decision.reached, decision.why) == ("stop", False, "gate condition")


def _after(known: Known, decision: Decision, draw: st.DataObject) -> Known:
    """What a world that may answer anything makes of a decision."""
    match decision.kind:
        case "measure" | "tell-apart":
            hopeless = {**known.hopeless, **({decision.pair: "asked"} if decision.pair else {})}
            unknown = draw.draw(st.booleans())
            return replace(
                known,
                poses=known.poses + decision.count,
                minutes=known.minutes + decision.count,
                predicted_um=draw.draw(UM),
                hopeless=hopeless,
                ambiguous=tuple(draw.draw(st.lists(PAIRS, max_size=2))),
                unexplained=unknown,
                rounds_unknown=known.rounds_unknown + 1 if unknown else 0,
                applied=False,
            )
        case "apply":
            return replace(known, applied=True, verified_um=None, corrections=known.corrections + 1)
        case "verify":
            return replace(known, verified_um=draw.draw(UM), minutes=known.minutes + 24.0)
        case "warm-up":
            assert known.creep is not None
            return replace(
                known,
                minutes=known.minutes + decision.minutes,
                waited=known.waited + decision.minutes,
                creep=known.creep.after(decision.minutes),
            )
    raise AssertionError(decision)


@given(st.data(), limits.filter(lambda wanted: math.isfinite(wanted.minutes)))
def test_it_ends_in_every_world_at_the_limit_of_time(draw: st.DataObject, wanted: Limits) -> None:
    known = Known()
    for _ in range(int(3 * wanted.minutes / FEWEST) + 40):
        decision = decide(known, wanted)
        if decision.kind == "stop":
            return
        known = _after(known, decision, draw)
    raise AssertionError("it goes on for ever")


def test_more_poses_are_as_many_as_the_prediction_needs() -> None:
    known = Known(poses=20, minutes=40.0, predicted_um=10.0)
    decision = decide(known, Limits(8.0))
    assert decision.kind == "measure"
    assert decision.count == math.ceil(20 * ((10.0 / 7.2) ** 2 - 1.0))
    assert decision.expected["predicted_um"] <= 7.2


def test_it_stops_before_time_is_spent_that_cannot_be_enough() -> None:
    known = Known(poses=20, minutes=40.0, predicted_um=40.0, falls=0.5)
    decision = decide(known, Limits(8.0, minutes=80.0))
    assert (decision.kind, decision.reached) == ("stop", False)
    assert "the 20 poses for which there is time would bring 28.3 um" in decision.why


def test_a_pair_is_told_apart_before_anything_is_written_and_once() -> None:
    pair = ("screw-pitch", "thermal-growth")
    known = Known(poses=20, predicted_um=3.0, ambiguous=(pair,))
    assert decide(known, Limits(8.0)).pair == pair
    assert decide(replace(known, hopeless={pair: "no poses"}), Limits(8.0)).kind == "apply"


def test_fresh_poses_that_disagree_are_looked_into_once() -> None:
    known = Known(poses=20, predicted_um=3.0, applied=True, corrections=1, verified_um=20.0)
    assert decide(known, Limits(8.0)).kind == "measure"
    assert decide(replace(known, corrections=2), Limits(8.0)).reached is False


@given(knowns, limits)
def test_it_is_let_warm_up_only_where_that_brings_something_that_can_be_afforded(
    known: Known, wanted: Limits
) -> None:
    decision = decide(known, wanted)
    cold = replace(known, creep=None)
    if decision.kind != "warm-up":
        assert decision == decide(cold, wanted)
        return
    creep, each = known.creep, known.minutes / known.poses
    assert creep is not None
    assert decide(cold, wanted).kind != "stop"
    assert creep.left_um > STEADY * wanted.target_um
    assert 0.0 < decision.minutes <= LONGEST_MIN
    kept = (PROOF if wanted.apply else FEWEST) * each
    assert decision.minutes <= wanted.minutes - known.minutes - kept
    then = decision.expected["creeps_um_then"]
    assert then <= 0.51 * creep.left_um or then <= 1.01 * STEADY * wanted.target_um
    after = replace(
        known, minutes=known.minutes + decision.minutes, waited=known.waited + decision.minutes,
        creep=creep.after(decision.minutes),
    )  # fmt: skip
    if then <= STEADY * wanted.target_um:
        assert decide(after, wanted).kind != "warm-up"


def test_what_is_not_sure_to_be_a_warm_up_is_looked_into_before_it_is_waited_for() -> None:
    pair, creep = ("leg-warm-up", "leg-warming"), Creep("leg-warm-up", 40.0, 15.0)
    known = Known(poses=20, minutes=40.0, predicted_um=3.0, ambiguous=(pair,), creep=creep)
    assert decide(known, Limits(8.0)).pair == pair
    known = replace(known, hopeless={pair: "no poses"})
    decision = decide(known, Limits(8.0))
    assert (decision.words(), decision.ground) == ("let it warm up for 45 min", "warm")
    assert decision.expected["creeps_um_then"] <= 2.0
    known = replace(known, declined=("warm",))
    assert decide(known, Limits(8.0)).kind == "apply"
    said = [one.words() for one in others(known, Limits(8.0), decide(known, Limits(8.0)))]
    assert "let it warm up for 45 min" in said


def test_a_warm_machine_is_not_reckoned_by_what_the_cold_one_has_shown() -> None:
    known = Known(poses=15, minutes=90.0, waited=60.0, predicted_um=50.0, warmed=True, falls=0.5)
    assert decide(known, Limits(8.0)).count == 15
    assert decide(known, Limits(8.0)).expected.keys() == {"at_most_um"}
    assert decide(known, Limits(8.0, minutes=130.0)).count == 15
    assert decide(replace(known, warmed=False), Limits(8.0)).count == MOST
    assert decide(replace(known, warmed=False), Limits(8.0, minutes=130.0)).kind == "stop"


def test_time_that_was_waited_is_not_the_time_of_a_pose() -> None:
    known = Known(poses=20, minutes=100.0, waited=60.0, predicted_um=10.0, falls=0.5)
    assert decide(known, Limits(8.0, minutes=140.0)).count == 19
    assert decide(replace(known, waited=0.0), Limits(8.0, minutes=140.0)).kind == "stop"
