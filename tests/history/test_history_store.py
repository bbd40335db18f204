"""The history: entries come back as they went in, in order, and a broken file is named."""

from pathlib import Path

import pytest

from app.history.store import FILE, Entry, History
from calib.errors import BadInput


def entry(kind: str = "fit", utc: str = "2026-11-29T06:00:00+00:00", **said: object) -> Entry:
    return Entry(kind, utc, "hexapod", "1001", "run", said)  # type: ignore[arg-type]


def test_entries_come_back_in_order_of_time(tmp_path: Path) -> None:
    history = History(tmp_path / "sessions")
    late, early = entry("applied", "2026-11-29T08:00:00+00:00", set=2), entry("fit", value=1.5)
    history.add(late)
    history.add(early)
    assert history.entries() == [early, late]
    assert history.entries("applied") == [late]


def test_a_fit_of_the_same_runs_takes_the_place_of_the_one_before(tmp_path: Path) -> None:
    history = History(tmp_path)
    for number in range(2):
        history.add(entry("fit", value=number))
        history.add(entry("applied", set=number))
    assert [one.said for one in history.entries("fit")] == [{"value": 1}]
    assert len(history.entries("applied")) == 2


def test_what_is_no_history_is_named(tmp_path: Path) -> None:
    assert History(tmp_path).entries() == []
    (tmp_path / FILE).write_text("no database, but long enough to be taken for one" * 40)
    with pytest.raises(BadInput, match="not a history"):
        History(tmp_path).entries()
    with pytest.raises(BadInput, match="cannot write"):
        History(tmp_path).add(entry())
