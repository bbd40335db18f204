"""The journal's laws: one reading a step, whole transactions, nothing ever deleted."""

import sqlite3
from pathlib import Path

import pytest

from app.session.journal import Journal, NewRow
from app.session.plan import Plan, Step
from calib.errors import BadInput

PLAN = Plan(
    "measure",
    "two",
    "hexapod",
    {"a": (0.0, 0.0, 220.0, 0.0, 0.0, 0.0)},
    (Step("0001-read-a-3", "read", "", {"pose": "a"}), Step("0002-read-a-4", "read", "")),
)
READING = NewRow("reading", 5.0, "a", (1.0, 2.0), "3", (1.0, 2.0, 3.0), (1e-5,) * 6)


@pytest.fixture
def journal(tmp_path: Path) -> Journal:
    made = Journal(tmp_path / "journal.sqlite")
    made.enter_plan(PLAN)
    return made


def test_it_is_written_through_to_the_disk(journal: Journal) -> None:
    assert journal._db.execute("PRAGMA journal_mode").fetchone()[0] == "wal"
    assert journal._db.execute("PRAGMA synchronous").fetchone()[0] == 2


def test_a_step_goes_from_planned_to_done_with_its_reading(journal: Journal) -> None:
    assert journal.states() == {}
    journal.started("0001-read-a-3", 1, 4.0, "now")
    assert journal.states()["0001-read-a-3"].state == "started"
    journal.done("0001-read-a-3", 1, 6.0, "now", {"nest": "3"}, READING)
    assert journal.states()["0001-read-a-3"].state == "done"
    assert [(row.nest, row.xyz) for row in journal.rows()] == [("3", (1.0, 2.0, 3.0))]
    assert journal.last_time() == 6.0


def test_a_step_can_never_have_two_good_readings(journal: Journal) -> None:
    journal.done("0001-read-a-3", 1, 6.0, "now", {}, READING)
    with pytest.raises(sqlite3.IntegrityError):
        journal.done("0001-read-a-3", 2, 9.0, "now", {}, READING)
    # The transaction went back as a whole: the second "done" is not there either.
    assert journal.states()["0001-read-a-3"].attempt == 1
    assert len(journal.rows()) == 1


def test_readings_set_aside_stay_and_their_steps_are_done_again(journal: Journal) -> None:
    journal.done("0001-read-a-3", 1, 6.0, "now", {}, READING)
    journal.invalidate("the stand moved", 7.0, "now")
    assert journal.rows() == []
    assert journal.rows(good_only=False)[0].why == "the stand moved"
    assert journal.states()["0001-read-a-3"].state == "failed"
    journal.done("0001-read-a-3", 2, 9.0, "now", {}, READING)
    assert len(journal.rows()) == 1


def test_another_process_reads_while_one_writes(journal: Journal, tmp_path: Path) -> None:
    other = Journal(tmp_path / "journal.sqlite", read_only=True)
    journal.done("0001-read-a-3", 1, 6.0, "now", {}, READING)
    assert len(other.rows()) == 1
    with pytest.raises(sqlite3.OperationalError, match="readonly"):
        other.note("remark", "from a viewer", 0.0, "now")
    other.close()


def test_a_journal_of_another_plan_is_refused(journal: Journal) -> None:
    other = Plan("measure", "", "hexapod", {}, (Step("0001-home", "home", ""),))
    with pytest.raises(BadInput, match="do not belong together"):
        journal.enter_plan(other)


def test_what_is_no_journal_is_named(tmp_path: Path) -> None:
    path = tmp_path / "journal.sqlite"
    path.write_text("this is no database, and long enough to be looked at " * 10)
    with pytest.raises(BadInput, match="not a journal"):
        Journal(path)
    with pytest.raises(BadInput, match="no journal"):
        Journal(tmp_path / "absent.sqlite", read_only=True)
