"""What to do next: one decision from what is known by now. No clock, no device, no file.

The order of the questions is that of a metrologist: nothing is believed of a machine of which two
descriptions fit (tell them apart), nothing is written whose uncertainty is larger than what is
wanted (measure more), and nothing counts that fresh poses have not shown (verify).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Kind = Literal["measure", "tell-apart", "apply", "verify", "stop"]
Ground = Literal["first", "pair", "unknown", "accuracy", "write", "prove", "disagree", ""]
"""Which question a decision answers; what was declined is not asked again of the same readings."""

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


@dataclass(frozen=True)
class Limits:
    """What is wanted, and what may be spent.

    Attributes
    ----------
    target_um : float
        RMS of the position error at fresh poses.
    minutes : float
        Machine minutes for everything; infinite if nobody set a limit.
    first : int
        Poses of the first set.
    apply : bool
        Whether a correction may be written to the machine.
    """

    target_um: float
    minutes: float = math.inf
    first: int = 15
    apply: bool = True


@dataclass(frozen=True)
class Known:
    """What is known by now.

    Attributes
    ----------
    poses, minutes : int, float
        Measured for the fit, and spent in all.
    predicted_um : float
        RMS of the position error at fresh poses by the covariance of what was identified.
    falls : float
        How that falls with the poses, as poses ** -falls: a half, unless the last set with the
        same effects has shown that it falls faster.
    ambiguous : tuple of (str, str)
        Effects that the readings cannot tell apart: one that the model has, and its rival.
    hopeless : mapping of (str, str) to str
        Pairs that no affordable measurement tells apart, and why.
    unexplained : bool
        Whether something is missing that no known effect explains.
    rounds_unknown : int
        Sets measured since then.
    verified_um : float, optional
        RMS at fresh poses without the part of the tracker, since the last correction.
    at_most_um : float, optional
        Its upper limit at 95 %: what the tracker's noise leaves open.
    applied : bool
        Whether the present model is on the machine.
    corrections : int
        How often one was written.
    declined : tuple of str
        Grounds of decisions to which the operator said no, since the last readings.
    """

    poses: int = 0
    minutes: float = 0.0
    predicted_um: float = math.inf
    falls: float = 0.5
    ambiguous: tuple[tuple[str, str], ...] = ()
    hopeless: Mapping[tuple[str, str], str] = field(default_factory=dict)
    unexplained: bool = False
    rounds_unknown: int = 0
    verified_um: float | None = None
    at_most_um: float | None = None
    applied: bool = False
    corrections: int = 0
    declined: tuple[str, ...] = ()
    ended: str = ""


@dataclass(frozen=True)
class Decision:
    """What is done next, and why.

    ``count`` poses; ``pair`` of effects where they are told apart; ``expected`` names what it
    should bring, in numbers; ``reached`` is of a stop: whether the target holds; ``ground`` is
    empty where the operator chose.
    """

    kind: Kind
    why: str
    count: int = 0
    pair: tuple[str, str] | None = None
    expected: Mapping[str, float] = field(default_factory=dict)
    reached: bool | None = None
    ground: Ground = ""

    def words(self) -> str:
        """What is done, in a few words."""
        match self.kind:
            case "measure":
                return f"measure {self.count} poses"
            case "tell-apart":
                assert self.pair is not None
                return f"tell {self.pair[0]} from {self.pair[1]}"
            case "apply":
                return "write the correction"
            case "verify":
                return "verify at fresh poses"
            case "stop":
                return "stop"


def decide(known: Known, limits: Limits) -> Decision:
    """Say what is done next."""
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
    left, each = limits.minutes - known.minutes, known.minutes / known.poses
    if math.isinf(limits.minutes) or each <= 0.0:
        return math.inf
    return float(max(0.0, left // each))


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
    wanted = math.ceil(min(known.poses * (short ** (1.0 / known.falls) - 1.0), NEVER))
    if affordable < FEWEST:
        return _stop(
            f"{known.predicted_um:.1f} um are predicted, and the time left is not enough for more "
            "poses",
            reached=False,
        )
    in_time = _in_time(known, limits)
    then = _then(known, in_time)
    if wanted > in_time and then > limits.target_um:
        return _stop(
            f"{known.predicted_um:.1f} um are predicted; the {in_time:.0f} poses for which there "
            f"is time would bring {then:.1f} um, {limits.target_um:g} um are wanted",
            reached=False,
        )
    count = min(max(FEWEST, wanted), MOST, affordable)
    return Decision(
        "measure",
        f"{known.predicted_um:.1f} um are predicted, {limits.target_um:g} um are wanted",
        count,
        expected={"predicted_um": _then(known, count)},
        ground="accuracy",
    )


def _then(known: Known, count: float) -> float:
    """What is predicted once there are so many poses more."""
    return float(known.predicted_um * (known.poses / (known.poses + count)) ** known.falls)


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
