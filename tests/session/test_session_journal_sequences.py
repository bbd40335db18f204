"""Whatever happens in whatever order, the journal says what a list in memory would say."""

import sqlite3
from pathlib import Path
from tempfile import TemporaryDirectory

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.session import kinds
from app.session.journal import Journal
from app.session.plan import Plan, Step
from app.session.rows import NewRow

STEPS = tuple(Step(f"000{k}-read-a-{k}", kinds.READ, "", {"pose": "a"}) for k in range(1, 4))
PLAN = Plan("measure", "three", "hexapod", {"a": (0.0, 0.0, 220.0, 0.0, 0.0, 0.0)}, STEPS)
WHAT = st.sampled_from(
    ["begin", "reading", "done", "fail", "skip", "reject", "move", "invalidate", "kill", "resume"]
)
HAPPENINGS = st.lists(st.tuples(WHAT, st.sampled_from([step.id for step in STEPS])), max_size=25)


def reading(number, status="good"):
    return NewRow("reading", float(number), "a", (1.0, 2.0), "3", (float(number), 2.0, 3.0),
                  (1e-5,) * 6, status=status)  # fmt: skip


class Told:
    """What should stand in the journal: state of each step, and all rows with their status."""

    def __init__(self):
        self.states, self.rows, self.attempt = {}, [], {}

    def good(self, step=None):
        return [
            row
            for row in self.rows
            if row[1] == "good" and row[3] == "reading" and step in (None, row[0])
        ]


def kill(path, step):
    """A process dies within the transaction of a reading and of the end of its step."""
    dying = sqlite3.connect(path, isolation_level=None)
    dying.execute("BEGIN IMMEDIATE")
    dying.execute(
        "INSERT INTO rows (step, attempt, kind, status, time_s, utc, pose, nest, q, channels, raw)"
        " VALUES (?, 9, 'reading', 'rejected', 1e6, '', 'a', '3', '[]', '{}', '{}')",
        (step,),
    )
    dying.close()


@pytest.mark.long
@settings(max_examples=40, deadline=None, derandomize=True)
@given(HAPPENINGS)
def test_session_journal_agrees_with_what_happened(happenings):
    with TemporaryDirectory() as folder:
        path = Path(folder) / "journal.sqlite"
        journal, told = Journal(path), Told()
        journal.enter_plan(PLAN)
        for number, (what, step) in enumerate(happenings, start=1):
            attempt = told.attempt.get(step, 0)
            if what == "begin":
                attempt = told.attempt[step] = attempt + 1
                journal.started(step, attempt, number, "now")
                told.states[step] = ("started", attempt)
            elif what == "reading":
                try:
                    journal.done(step, attempt, number, "now", {"n": number}, reading(number))
                except sqlite3.IntegrityError:
                    assert told.good(step)  # never two good readings: nothing was written
                else:
                    assert not told.good(step)
                    told.rows.append([step, "good", float(number), "reading"])
                    told.states[step] = ("done", attempt)
            elif what == "done":
                journal.done(step, attempt, number, "now", {})
                told.states[step] = ("done", attempt)
            elif what == "fail":
                journal.failed(step, attempt, number, "now", "it broke")
                told.states[step] = ("failed", attempt)
            elif what == "skip":
                journal.skipped(step, attempt, number, "now", "not today")
                told.states[step] = ("skipped", attempt)
            elif what == "reject":
                journal.add_row(step, attempt, "now", reading(number, "rejected"))
                told.rows.append([step, "rejected", float(number), "reading"])
            elif what == "move":
                journal.add_row(step, attempt, "now", NewRow("move", float(number), "a", (1.0,)))
                told.rows.append([step, "good", float(number), "move"])
            elif what == "invalidate":
                journal.invalidate("another tracker", number, "now")
                for row in told.good():
                    row[1] = "invalidated"
                for other, (state, tried) in told.states.items():
                    if state == "done":
                        told.states[other] = ("failed", tried)
            elif what == "kill":
                kill(path, step)
            else:
                journal.close()
                journal = Journal(path)
                journal.enter_plan(PLAN)
            agree(journal, told)
        reader = Journal(path, read_only=True)
        agree(reader, told)
        reader.close()
        journal.close()


def agree(journal, told):
    found = {step: (s.state, s.attempt) for step, s in journal.states().items()}
    assert found == told.states
    rows = [[r.step, r.status, r.time_s, r.kind] for r in journal.rows(good_only=False)]
    assert rows == told.rows
    assert [r.time_s for r in journal.rows()] == [r[2] for r in told.rows if r[1] == "good"]
    assert journal.readings() == len(told.good())
    last = journal.last_row()
    assert (last.time_s if last else None) == (told.rows[-1][2] if told.rows else None)
    for step in STEPS:
        state = told.states.get(step.id, ("planned", 0))
        assert journal.state(step.id).pending == (state[0] not in ("done", "skipped"))
