"""What is wanted, what is known, and a decision: the records that the policy goes by."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

Kind = Literal["measure", "tell-apart", "warm-up", "apply", "verify", "stop"]
Ground = Literal["first", "pair", "unknown", "warm", "accuracy", "write", "prove", "disagree", ""]
"""Which question a decision answers; what was declined is not asked again of the same readings."""
SLOWEST, FASTEST = 0.5, 2.0
"""Powers of the number of poses by which a prediction is taken to fall."""


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
class Creep:
    """What a machine creeps while it warms up.

    ``effect`` of the model that says so; ``left_um``: by how much the platform is not yet where it
    will be, RMS at fresh poses; it fades by exp(-t / ``tau_min``).
    """

    effect: str
    left_um: float
    tau_min: float

    def after(self, minutes: float) -> "Creep":
        """So many minutes later, if the machine goes on as it did."""
        return Creep(self.effect, self.left_um * math.exp(-minutes / self.tau_min), self.tau_min)


@dataclass(frozen=True)
class Known:
    """What is known by now.

    Attributes
    ----------
    poses, minutes : int, float
        Measured for the fit, and spent in all.
    predicted_um : float
        RMS of the position error at fresh poses by the covariance of what was identified.
    falls : float, optional
        How that falls with the poses, as poses ** -falls, by the last set with the same effects.
        Without one it is planned with a half, and nothing is given up for it.
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
    waited : float
        Minutes of those spent in which nothing was measured: it was let warm up.
    warmed : bool
        Whether it was since the last readings: a warm machine has fewer unknowns, and how the
        prediction falls with its poses is not known yet.
    creep : Creep, optional
        What the machine still creeps while it warms up.
    ended : str
        Why it is over; empty if it is not.
    """

    poses: int = 0
    minutes: float = 0.0
    predicted_um: float = math.inf
    falls: float | None = None
    ambiguous: tuple[tuple[str, str], ...] = ()
    hopeless: Mapping[tuple[str, str], str] = field(default_factory=dict)
    unexplained: bool = False
    rounds_unknown: int = 0
    verified_um: float | None = None
    at_most_um: float | None = None
    applied: bool = False
    corrections: int = 0
    declined: tuple[str, ...] = ()
    waited: float = 0.0
    warmed: bool = False
    creep: Creep | None = None
    ended: str = ""


@dataclass(frozen=True)
class Decision:
    """What is done next, and why.

    ``count`` poses; ``minutes`` that it takes to warm up; ``pair`` of effects where they are told
    apart; ``expected`` names what it
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
    minutes: float = 0.0

    def words(self) -> str:
        """What is done, in a few words."""
        match self.kind:
            case "measure":
                return f"measure {self.count} poses"
            case "tell-apart":
                assert self.pair is not None
                return f"tell {self.pair[0]} from {self.pair[1]}"
            case "warm-up":
                return f"let it warm up for {self.minutes:.0f} min"
            case "apply":
                return "write the correction"
            case "verify":
                return "verify at fresh poses"
            case "stop":
                return "stop"
