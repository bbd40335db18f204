"""What is left is told from how long steps of its kinds took."""

import pytest

from app.session import kinds
from app.session.pace import Pace
from app.session.plan import Step


def step(number: int, kind: kinds.StepKind) -> Step:
    return Step(f"s{number}", kind, "", {})


def test_time_left_is_that_of_the_kinds_that_are_left() -> None:
    pace = Pace()
    due = [step(k, (kinds.MOVE, kinds.READ)[k % 2]) for k in range(20)]
    pace.took(step(100, kinds.CONNECT), 300.0)  # a warm-up, an SMR that was carried: not again
    assert pace.left(due) is None
    pace.took(step(101, kinds.MOVE), 2.0)
    pace.took(step(102, kinds.MOVE), 4.0)
    pace.took(step(103, kinds.READ), 5.0)
    assert pace.left(due) == pytest.approx(10 * 3.0 + 10 * 5.0)
    assert pace.left(due[:5]) == pytest.approx(3 * 3.0 + 2 * 5.0)
    assert pace.left([]) == 0.0


def test_what_is_of_no_known_kind_counts_as_the_others() -> None:
    pace = Pace()
    pace.took(step(1, kinds.READ), 5.0)
    due = [step(2, kinds.READ), step(3, kinds.DRIFT)]
    assert pace.left(due) == pytest.approx(10.0)
    assert pace.left([*due, step(4, kinds.DRIFT)]) is None
