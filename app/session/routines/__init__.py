"""What the engine does for each kind of step."""

from collections.abc import Callable, Coroutine
from typing import Any

from app.session.plan import Step
from app.session.routines.carrying import carry, confirm
from app.session.routines.moving import home, move
from app.session.routines.preparing import check_path, connect, drives, rest, tracker, warm_up
from app.session.routines.reading import read
from app.session.routines.referencing import drift, reference, two_face
from app.session.routines.truth import truth
from app.session.work import Done, Work

Routine = Callable[[Work, Step], Coroutine[Any, Any, Done]]

ROUTINES: dict[str, Routine] = {
    "connect": connect,
    "check-path": check_path,
    "tracker": tracker,
    "drives": drives,
    "warm-up": warm_up,
    "home": home,
    "move": move,
    "carry": carry,
    "confirm": confirm,
    "read": read,
    "reference": reference,
    "drift": drift,
    "two-face": two_face,
    "rest": rest,
    "truth": truth,
}

# Done again whenever a process takes a session over: what they check is not in the journal.
EVERY_TIME = frozenset({"connect", "check-path", "tracker", "drives"})

NEVER_SKIPPED = frozenset({"connect", "check-path", "tracker", "drives", "rest"})
