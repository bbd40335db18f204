"""The journal's laws: one reading a step, whole transactions, nothing ever deleted."""

import sqlite3
from pathlib import Path

import pytest

from app.session import kinds
from app.session.journal import Journal
from app.session.plan import Plan, Step
from app.session.rows import NewRow
from calib.errors import BadInput

PLAN = Plan(
    "measure",
    "two",
    "hexapod",
    {"a": (0.0, 0.0, 220.0, 0.0, 0.0, 0.0)},
    (Step("0001-read-a-3", kinds.READ, "", {"pose": "a"}), Step("0002-read-a-4", kinds.READ, "")),
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


@pytest.mark.parametrize(("table", "when"), [("log", "NEW.state = 'done'"), ("rows", "1")])
def test_a_reading_and_the_end_of_its_step_are_there_together_or_not_at_all(
    journal: Journal, tmp_path: Path, table: str, when: str
) -> None:
    """Whichever of the two statements fails, neither is left; the next attempt writes both."""
    journal.started("0001-read-a-3", 1, 4.0, "now")
    journal._db.execute(
        f"CREATE TEMP TRIGGER broken BEFORE INSERT ON main.{table} WHEN {when} "
        "BEGIN SELECT RAISE(ABORT, 'the disk is full'); END"
    )
    with pytest.raises(sqlite3.IntegrityError, match="the disk is full"):
        journal.done("0001-read-a-3", 1, 6.0, "now", {}, READING)
    with sqlite3.connect(tmp_path / "journal.sqlite") as other:
        assert other.execute("SELECT count(*) FROM rows").fetchone() == (0,)
        assert other.execute("SELECT state FROM log").fetchall() == [("started",)]
    assert (journal.state("0001-read-a-3").state, journal.readings()) == ("started", 0)
    journal._db.execute("DROP TRIGGER broken")
    journal.done("0001-read-a-3", 1, 6.0, "now", {}, READING)
    assert (journal.state("0001-read-a-3").state, journal.readings()) == ("done", 1)


def test_states_are_those_of_a_journal_that_is_opened_anew(
    journal: Journal, tmp_path: Path
) -> None:
    viewer = Journal(tmp_path / "journal.sqlite", read_only=True)
    first, second = (step.id for step in PLAN.steps)
    write = [
        lambda: journal.started(first, 1, 1.0, "now"),
        lambda: journal.failed(first, 1, 2.0, "now", "no beam"),
        lambda: journal.started(first, 2, 3.0, "now"),
        lambda: journal.done(first, 2, 4.0, "now", {"nest": "3"}, READING),
        lambda: journal.skipped(second, 1, 5.0, "now", "a bird"),
        lambda: journal.invalidate("the stand moved", 6.0, "now"),
    ]
    for step in write:
        step()
        anew = Journal(tmp_path / "journal.sqlite", read_only=True)
        assert journal.states() == viewer.states() == anew.states()
        assert max(state.entry for state in anew.states().values()) == anew.last_entry()
        anew.close()
    assert [journal.state(step).state for step in (first, second)] == ["failed", "skipped"]
    viewer.close()


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
    other = Plan("measure", "", "hexapod", {}, (Step("0001-home", kinds.HOME, ""),))
    with pytest.raises(BadInput, match="do not belong together"):
        journal.enter_plan(other)


def test_what_is_no_journal_is_named(tmp_path: Path) -> None:
    path = tmp_path / "journal.sqlite"
    path.write_text("this is no database, and long enough to be looked at " * 10)
    with pytest.raises(BadInput, match="not a journal"):
        Journal(path)
    with pytest.raises(BadInput, match="no journal"):
        Journal(tmp_path / "absent.sqlite", read_only=True)
