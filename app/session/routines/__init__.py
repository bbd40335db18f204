"""What the engine does for each kind of step."""

from collections.abc import Callable, Coroutine
from typing import Any

from app.session import kinds
from app.session.kinds import StepKind
from app.session.plan import Step
from app.session.routines.carrying import carry, confirm
from app.session.routines.directions import directions
from app.session.routines.following import follows
from app.session.routines.gauging import apart, between_marks, gauge, mark, touch
from app.session.routines.moving import exercise, home, move
from app.session.routines.preparing import check_path, connect, drives, rest, tracker, warm_up
from app.session.routines.probing import probe
from app.session.routines.reading import read
from app.session.routines.referencing import drift, reference, two_face
from app.session.routines.truth import truth
from app.session.work import Done, Work

Routine = Callable[[Work, Step], Coroutine[Any, Any, Done]]

ROUTINES: dict[StepKind, Routine] = {
    kinds.CONNECT: connect,
    kinds.CHECK_PATH: check_path,
    kinds.TRACKER: tracker,
    kinds.DRIVES: drives,
    kinds.WARM_UP: warm_up,
    kinds.EXERCISE: exercise,
    kinds.HOME: home,
    kinds.MOVE: move,
    kinds.CARRY: carry,
    kinds.CONFIRM: confirm,
    kinds.DIRECTIONS: directions,
    kinds.READ: read,
    kinds.REFERENCE: reference,
    kinds.DRIFT: drift,
    kinds.TWO_FACE: two_face,
    kinds.REST: rest,
    kinds.TRUTH: truth,
    kinds.GAUGE: gauge,
    kinds.TOUCH: touch,
    kinds.PROBE: probe,
    kinds.FOLLOWS: follows,
    kinds.APART: apart,
    kinds.MARK: mark,
    kinds.BETWEEN: between_marks,
}
