"""A journal that is damaged anywhere is named, or says what it said; never something else."""

import random
import shutil
import sqlite3
from pathlib import Path

import pytest

from app.session import kinds
from app.session.facts import facts_of, sessions_under
from app.session.journal import Journal
from app.session.plan import Plan, Step
from app.session.rows import NewRow
from calib.errors import BadInput

STEPS = tuple(Step(f"{k:04d}-read-a-{k}", kinds.READ, "", {"pose": "a"}) for k in range(12))
PLAN = Plan("measure", "twelve", "hexapod", {"a": (0.0, 0.0, 220.0, 0.0, 0.0, 0.0)}, STEPS)


def filled(folder: Path) -> Path:
    path = folder / "journal.sqlite"
    journal = Journal(path)
    journal.enter_plan(PLAN)
    journal.set_meta("controller_parameters", {"leg1.L0": 230.715, "leg2.L0": 230.8})
    for k, step in enumerate(STEPS):
        journal.started(step.id, 1, 2.0 * k, "2026-01-01T00:00:00+00:00")
        xyz, sigma = (100.0 + k, -20.5 * k, 3.25), (1e-5,) * 6
        row = NewRow("reading", 2.0 * k + 1, "a", (1.0, 2.0), f"{k}", xyz, sigma, raw={"n": k})
        journal.done(step.id, 1, 2.0 * k + 1, "2026-01-01T00:00:01+00:00", {"nest": f"{k}"}, row)
    journal.close()
    return path


def said(path: Path) -> object:
    journal = Journal(path, read_only=True)
    try:
        return (
            journal.rows(), dict(journal.states()), journal.meta("controller_parameters"),
            journal.readings(), journal.log(),
        )  # fmt: skip
    finally:
        journal.close()


def test_bytes_that_flip_are_noticed_or_change_nothing(tmp_path: Path) -> None:
    path = filled(tmp_path)
    whole, true = path.read_bytes(), said(path)
    dice = random.Random(4)
    noticed: list[BadInput] = []
    for _ in range(250):
        data = bytearray(whole)
        for _ in range(dice.choice((1, 1, 3, 40))):
            data[dice.randrange(len(data))] ^= 1 << dice.randrange(8)
        path.write_bytes(data)
        try:
            assert said(path) == true
        except BadInput as damaged:
            noticed.append(damaged)
    assert len(noticed) > 20
    assert all(str(path) in str(damaged) and damaged.remedy for damaged in noticed)


def test_a_reading_that_was_edited_by_hand_is_no_reading(tmp_path: Path) -> None:
    path = filled(tmp_path)
    with sqlite3.connect(path) as other:
        other.execute("UPDATE rows SET xyz = '[100.0, -20.5, 3.26]' WHERE seq = 2")
    with pytest.raises(BadInput, match="is not what was written"):
        Journal(path)


@pytest.mark.parametrize("gone", ["rows WHERE seq = 12", "log WHERE seq = 3"])
def test_an_entry_that_is_missing_is_noticed(tmp_path: Path, gone: str) -> None:
    path = filled(tmp_path)
    with sqlite3.connect(path) as other:
        other.execute(f"DELETE FROM {gone}")
    with pytest.raises(BadInput, match="missing"):
        Journal(path, read_only=True)


def test_a_file_that_was_cut_is_noticed(tmp_path: Path) -> None:
    path = filled(tmp_path)
    whole = path.read_bytes()
    for size in (0, 50, 4096, len(whole) // 2, len(whole) - 4096):
        path.write_bytes(whole[:size])
        with pytest.raises(BadInput, match=r"not a journal|damaged"):
            Journal(path, read_only=True)


def test_journals_of_before_are_read_and_gone_on_with(tmp_path: Path) -> None:
    path = filled(tmp_path)
    true = said(path)
    with sqlite3.connect(path) as other:
        for table in ("meta", "log", "rows"):
            other.execute(f"ALTER TABLE {table} DROP COLUMN sum")
    assert said(path) == true
    journal = Journal(path)
    journal.set_meta("finished_utc", "now")
    journal.close()
    assert said(path) == true


def test_without_its_wal_an_older_state_is_gone_on_with(tmp_path: Path) -> None:
    path = filled(tmp_path)
    before = said(path)
    journal = Journal(path)
    journal.note("remark", "in the WAL alone", 0.0, "now")
    (tmp_path / "copy").mkdir()
    copy = shutil.copy(path, tmp_path / "copy" / path.name)
    journal.close()
    assert said(Path(copy)) == before


@pytest.mark.parametrize("replaced", [False, True])
def test_a_folder_that_is_removed_meanwhile_takes_nothing_more(
    tmp_path: Path, replaced: bool
) -> None:
    """On Linux the file would go on without a name, and everything with it."""
    path = filled(tmp_path)
    journal = Journal(path)
    path.rename(tmp_path / "elsewhere")
    if replaced:
        path.write_bytes(b"")
    with pytest.raises(OSError, match="removed or replaced"):
        journal.started(STEPS[0].id, 2, 99.0, "now")
    with pytest.raises(OSError, match="removed or replaced"):
        journal.done(STEPS[0].id, 2, 99.0, "now", {})
    journal.close()


def test_a_list_of_sessions_names_the_broken_one(tmp_path: Path) -> None:
    for name in ("20260101-000000-hexapod-measure", "20260102-000000-hexapod-measure"):
        (tmp_path / name).mkdir()
        filled(tmp_path / name)
        (tmp_path / name / "plan.json").write_text(PLAN.to_json())
    broken = tmp_path / "20260101-000000-hexapod-measure" / "journal.sqlite"
    broken.write_bytes(b"\xff" * 8192)
    assert facts_of(broken.parent).state == "broken"
    assert [facts.state for facts in sessions_under(tmp_path)] == ["begun", "broken"]
