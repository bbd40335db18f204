"""What to do next: one decision from what is known by now. No clock, no device, no file.

The order of the questions is that of a metrologist: nothing is believed of a machine of which two
descriptions fit (tell them apart), nothing is written whose uncertainty is larger than what is
wanted (measure more), and nothing counts that fresh poses have not shown (verify).
"""

import math

from app.auto.decision import FASTEST, SLOWEST, Decision, Ground, Known, Limits

SURE = 0.8
"""A follow-up is worth its time if it gives the right answer with this probability."""
FEWEST, MOST = 6, 60
"""Poses of one more set: fewer are not worth the walk to the machine, more are decided again."""
NEVER = 1e6
"""So many poses nobody measures."""
SPARE = 0.9
"""Part of the target that a set of poses is planned for."""
APART = 10
"""Poses that tell a pair apart."""
ROUNDS_UNKNOWN = 2
"""Sets of poses that are measured after something was found that no known effect explains."""
PROOF = 24
"""Poses of a verification, for which time is kept."""
STEADY = 0.25
"""Part of the target that a machine may still creep: 3 % more where squares add."""
LONGEST_MIN = 120.0
"""More than this is not waited for at once, and what is slower is no warm-up."""


def decide(known: Known, limits: Limits) -> Decision:
    """Say what is done next; what needs a warm machine is put off until it is."""
    due = _due(known, limits)
    return _warm_first(known, limits, due) or due


def _due(known: Known, limits: Limits) -> Decision:
    """What is to be done of a machine as it is."""
    if known.ended:
        return _stop(known.ended, reached=False)
    if known.poses == 0:
        if "first" in known.declined:
            return _declined("nothing was measured")
        first = min(limits.first, MOST)
        return Decision("measure", "nothing was measured yet", first, ground="first")
    if known.verified_um is not None and known.verified_um <= limits.target_um:
        return _stop(
            f"fresh poses show {shown(known)}, {limits.target_um:g} um are wanted",
            reached=True,
        )
    affordable = _affordable(known, limits)
    asked = _apart(known, affordable) or _unknown(known, affordable)
    if asked is not None:
        return asked
    if known.predicted_um > limits.target_um and "accuracy" not in known.declined:
        return _more(known, limits, affordable)
    return _prove(known, limits, affordable)


def _affordable(known: Known, limits: Limits) -> int:
    """Poses of one more set for which there is time."""
    return int(min(MOST, _in_time(known, limits)))


def _in_time(known: Known, limits: Limits) -> float:
    """Poses for which there is time in all, by what the ones before have taken; may be infinite."""
    left, each = limits.minutes - known.minutes, _each(known)
    if math.isinf(limits.minutes) or each <= 0.0:
        return math.inf
    return float(max(0.0, left // each))


def _each(known: Known) -> float:
    """Minutes that a pose has taken."""
    return (known.minutes - known.waited) / known.poses


def _warm_first(known: Known, limits: Limits, due: Decision) -> Decision | None:
    """Let it warm up before what is due, where it creeps by more than the target leaves room for.

    Not before it is known that it is this and nothing else, nor where less than half of it would
    be gone in the time that is left.
    """
    creep = known.creep
    if creep is None or due.kind == "stop" or "warm" in known.declined:
        return None
    if due.pair is not None and creep.effect in due.pair:
        return None
    wanted = warm_up_min(known, limits)
    if wanted <= 0.0:
        return None
    kept = PROOF * _each(known) if limits.apply else FEWEST * _each(known)
    minutes = math.floor(min(wanted, limits.minutes - known.minutes - kept))
    if minutes < min(wanted, creep.tau_min * math.log(2.0)):
        return None
    return _warming(known, minutes, f"it creeps while it warms up ({creep.effect})", "warm")


def warm_up_min(known: Known, limits: Limits) -> float:
    """Whole minutes after which what it creeps is small beside the target; 0 if it is, or never."""
    creep = known.creep
    if creep is None or creep.tau_min > LONGEST_MIN:
        return 0.0
    short = creep.left_um / (STEADY * limits.target_um)
    return min(math.ceil(creep.tau_min * math.log(short)), LONGEST_MIN) if short > 1.0 else 0.0


def _warming(known: Known, minutes: float, why: str, ground: Ground) -> Decision:
    creep = known.creep
    assert creep is not None
    then = creep.after(minutes)
    return Decision(
        "warm-up",
        f"{why}, with a time constant of {creep.tau_min:.0f} min",
        minutes=minutes,
        expected={"creeps_um": creep.left_um, "creeps_um_then": then.left_um},
        ground=ground,
    )


def _apart(known: Known, affordable: int) -> Decision | None:
    """The first pair that is in question and not hopeless."""
    for pair in known.ambiguous:
        if pair in known.hopeless or affordable < FEWEST:
            continue
        one, other = pair
        return Decision(
            "tell-apart",
            f"the readings cannot tell {one} from {other}",
            min(APART, affordable),
            pair,
            ground="pair",
        )
    return None


def _unknown(known: Known, affordable: int) -> Decision | None:
    asked_enough = known.rounds_unknown >= ROUNDS_UNKNOWN or "unknown" in known.declined
    if not known.unexplained or asked_enough or affordable < FEWEST:
        return None
    return Decision(
        "measure",
        "something is missing that no known effect explains: more poses may show what it is",
        min(_half_again(known), affordable),
        ground="unknown",
    )


def _half_again(known: Known) -> int:
    """Poses of a set that looks for something unknown: half as many as there are."""
    return max(FEWEST, min(MOST, known.poses // 2))


def _more(known: Known, limits: Limits, affordable: int) -> Decision:
    """As many poses as bring the prediction below the target, by how it falls with them."""
    short = known.predicted_um / (SPARE * limits.target_um)
    falls = SLOWEST if known.falls is None else known.falls
    wanted = math.ceil(min(known.poses * (short ** (1.0 / falls) - 1.0), NEVER))
    if affordable < FEWEST:
        return _stop(
            f"{known.predicted_um:.1f} um are predicted, and the time left is not enough for more "
            "poses",
            reached=False,
        )
    in_time = _in_time(known, limits)
    seen = known.falls is not None
    at_best = _then(known, in_time, falls if seen else FASTEST)
    if wanted > in_time and at_best > limits.target_um and not known.warmed:
        return _stop(
            f"{known.predicted_um:.1f} um are predicted; the {in_time:.0f} poses for which there "
            f"is time would bring {at_best:.1f} um{'' if seen else ' at best'}, "
            f"{limits.target_um:g} um are wanted",
            reached=False,
        )
    # As many again as there are show how it falls.
    doubled = known.warmed or (wanted > in_time and not seen)
    most = max(FEWEST, known.poses) if doubled else MOST
    count = min(max(FEWEST, wanted), most, MOST, affordable)
    return Decision(
        "measure",
        f"{known.predicted_um:.1f} um are predicted, {limits.target_um:g} um are wanted",
        count,
        expected={"at_most_um" if known.warmed else "predicted_um": _then(known, count, falls)},
        ground="accuracy",
    )


def _then(known: Known, count: float, falls: float) -> float:
    """What is predicted once there are so many poses more, where it falls by that power."""
    return float(known.predicted_um * (known.poses / (known.poses + count)) ** falls)


def _prove(known: Known, limits: Limits, affordable: int) -> Decision:
    """The prediction is good enough: write it, and see whether fresh poses agree."""
    if not limits.apply:
        return _stop(
            f"{known.predicted_um:.1f} um are predicted; writing was not asked for", reached=None
        )
    if not known.applied:
        if known.corrections and known.verified_um is not None and affordable < FEWEST:
            return _missed(known, limits)
        if "write" in known.declined:
            return _declined(f"{known.predicted_um:.1f} um are predicted, and nothing was written")
        return Decision(
            "apply",
            f"{known.predicted_um:.1f} um are predicted, {limits.target_um:g} um are wanted",
            expected={"predicted_um": known.predicted_um},
            ground="write",
        )
    if known.verified_um is None:
        if "prove" in known.declined:
            return _declined("the correction is written, and no fresh pose has shown what it is")
        return Decision(
            "verify",
            "only fresh poses show what the machine keeps",
            expected={"rms_um": known.predicted_um},
            ground="prove",
        )
    if known.corrections > 1 or affordable < FEWEST or "disagree" in known.declined:
        return _missed(known, limits)
    return Decision(
        "measure",
        f"fresh poses show {shown(known)}, {known.predicted_um:.1f} um were predicted: "
        "the model lacks something that these readings do not show",
        min(_half_again(known), affordable),
        ground="disagree",
    )


def others(known: Known, limits: Limits, proposed: Decision) -> tuple[Decision, ...]:
    """What the operator may choose instead of what is proposed."""
    why = "the operator chose it"
    if known.poses == 0:
        return ()
    affordable = _affordable(known, limits)
    found = []
    if affordable >= FEWEST:
        if proposed.kind != "measure":
            found.append(Decision("measure", why, min(_half_again(known), affordable)))
        found += [
            Decision("tell-apart", why, min(APART, affordable), pair)
            for pair in dict.fromkeys(known.ambiguous)
            if pair != proposed.pair
        ]
    if proposed.kind != "warm-up" and 0.0 < (wait := warm_up_min(known, limits)) <= (
        limits.minutes - known.minutes
    ):
        found.append(_warming(known, wait, why, ""))
    good = math.isfinite(known.predicted_um)
    if limits.apply and good and not known.applied and proposed.kind != "apply":
        expected = {"predicted_um": known.predicted_um}
        found.append(Decision("apply", why, expected=expected))
    if known.applied and proposed.kind != "verify":
        found.append(Decision("verify", why, expected={"rms_um": known.predicted_um}))
    return tuple(found)


def _missed(known: Known, limits: Limits) -> Decision:
    return _stop(
        f"fresh poses show {shown(known)}, {limits.target_um:g} um are wanted; "
        "no measurement that can be afforded would change that",
        reached=False,
    )


def shown(known: Known) -> str:
    """The verified error in words."""
    assert known.verified_um is not None
    limit = "" if known.at_most_um is None else f" (95 %: at most {known.at_most_um:.1f} um)"
    return f"{known.verified_um:.1f} um RMS{limit}"


def _declined(why: str) -> Decision:
    return _stop(f"{why}: the operator said no", reached=False)


def _stop(why: str, *, reached: bool | None) -> Decision:
    return Decision("stop", why, reached=reached)
