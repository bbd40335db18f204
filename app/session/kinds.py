"""The kinds of steps that a plan can have, with what each of them means to whoever meets one.

A stored plan names a kind by its word; the traits are looked up here and nowhere else.
"""

from dataclasses import dataclass
from typing import Literal

from calib.errors import BadInput

Goal = Literal["nowhere", "home", "pose", "round"]


@dataclass(frozen=True)
class StepKind:
    """One kind of step.

    ``name`` is its word in plans and journals. ``words`` tell the operator what it does; what is
    in braces comes from the step's arguments.
    """

    name: str
    words: str
    moves_to: Goal = "nowhere"
    """Where the machine stands when it is done: ``pose`` is the one among the step's arguments,
    ``round`` the last of those."""
    rests_on_readings: bool = False
    """Whether it is to be done again when the readings so far are set aside."""
    every_time: bool = False
    """Whether it is done again when a session is taken over: its result is in no journal."""
    skippable: bool = True
    """Whether the operator may leave it out."""
    often: bool = False
    """Whether there are too many of them to tell the end of each on a console."""


CONNECT = StepKind(
    "connect", "identities and the controller's parameters", every_time=True, skippable=False
)
CHECK_PATH = StepKind(
    "check-path", "the whole path against all limits", every_time=True, skippable=False
)
TRACKER = StepKind(
    "tracker", "initialise the tracker, choose the reflector", every_time=True, skippable=False
)
DRIVES = StepKind("drives", "drives on", every_time=True, skippable=False)
WARM_UP = StepKind("warm-up", "wait until laser and machine are warm and steady")
EXERCISE = StepKind("exercise", "keep the machine moving, {minutes:g} min", moves_to="round")
HOME = StepKind("home", "go to the home pose", moves_to="home", often=True)
MOVE = StepKind("move", "move to pose {pose}", moves_to="pose", often=True)
CARRY = StepKind("carry", "SMR {smr} into nest {nest}")
CONFIRM = StepKind("confirm", "is it nest {nest} that the tracker sees?", moves_to="home")
DIRECTIONS = StepKind(
    "directions", "each actuator alone, a little: does it move the platform as drawn?",
    moves_to="home",
)  # fmt: skip
READ = StepKind("read", "read nest {nest}", moves_to="pose", rests_on_readings=True, often=True)
REFERENCE = StepKind("reference", "reference nest {nest} on the base", rests_on_readings=True)
DRIFT = StepKind("drift", "drift of the base", rests_on_readings=True)
TWO_FACE = StepKind("two-face", "two-face check of the tracker")
TRUTH = StepKind("truth", "the mock's true pose at {pose}", moves_to="pose", often=True)
GAUGE = StepKind("gauge", "does the gauge answer?", every_time=True, skippable=False)
APART = StepKind("apart", "take it off: the machine moves", skippable=False)
TOUCH = StepKind("touch", "read it at {pose}", moves_to="pose", often=True)
PROBE = StepKind("probe", "lower it at {of} until it touches", moves_to="pose", often=True)
FOLLOWS = StepKind("follows", "does the gauge follow at {of}?", moves_to="pose")
MARK = StepKind("mark", "leave a mark at {pose}", moves_to="pose")
BETWEEN = StepKind("between", "measure between marks {pose} and {pose2}", often=True)
REST = StepKind("rest", "take the power off the drives", skippable=False)

KINDS: dict[str, StepKind] = {
    kind.name: kind
    for kind in (
        CONNECT, CHECK_PATH, TRACKER, DRIVES, WARM_UP, EXERCISE, HOME, MOVE, CARRY, CONFIRM,
        DIRECTIONS, READ, REFERENCE, DRIFT, TWO_FACE, TRUTH, GAUGE, APART, TOUCH, PROBE, FOLLOWS,
        MARK, BETWEEN, REST,
    )
}  # fmt: skip
"""Every kind by its word."""


def kind_named(name: object, source: str) -> StepKind:
    """Look up a stored kind; raises :class:`BadInput` for one that is not known here."""
    found = KINDS.get(name) if isinstance(name, str) else None
    if found is None:
        raise BadInput(
            f"a step of the unknown kind {name!r}",
            place=source,
            remedy="Go on with the version of pkmcal that began the session, or measure anew",
        )
    return found
