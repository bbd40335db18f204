"""Parameter sets that are known: files that never change, and what is refused at connect."""

import asyncio
import json
import sqlite3
import threading
from pathlib import Path

import pytest
from session_lab import Lab, lab_in

from app.session.journal import Journal
from app.session.known import FORMAT, Held, Snapshot, Snapshots, compare_with_known
from app.session.rows import NewRow
from app.writeback.transfer import Wanted, prove, write_volatile
from calib.errors import BadInput
from drivers.errors import ParameterError
from drivers.interface import Identity

WHO = Identity("canopen", "maker", "hexapod", "17", "1.0")
HELD = Held({"leg1.L0": 0.1 + 0.2, "leg2.L0": -1.0}, 7, {"my-effect": "text"})


@pytest.fixture
def snapshots(tmp_path: Path) -> Snapshots:
    return Snapshots("hexapod", WHO, tmp_path)


@pytest.fixture
def lab(tmp_path: Path) -> Lab:
    return lab_in(tmp_path)


def known_of(lab: Lab) -> Snapshots:
    return Snapshots(lab.room.site.machine.name, lab.controller.identity)


def compared(lab: Lab, trial: dict[str, float] | None = None) -> Held:
    return asyncio.run(compare_with_known(lab.room.site, lab.controller, trial))


def test_each_set_is_found_by_its_own_number(snapshots: Snapshots) -> None:
    saved = [snapshots.save(HELD, why) for why in ("first", "second", "third")]
    assert [one.number for one in saved] == [1, 2, 3]
    assert snapshots.all() == saved
    assert [snapshots.get(number).why for number in (3, 1, 2)] == ["third", "first", "second"]
    assert saved[0].values == HELD.values
    snapshots.path(saved[1]).unlink()
    for missing in (2, 4):  # never its neighbour instead
        with pytest.raises(BadInput, match=f"no snapshot {missing}"):
            snapshots.get(missing)


def test_a_set_of_another_format_is_none(snapshots: Snapshots) -> None:
    text = snapshots.save(HELD, "first").to_json()
    assert Snapshot.from_json(text, "0001.json").values == HELD.values
    for other in ("pkm-parameters/2", "", None):
        wrong = json.dumps({**json.loads(text), "format": other})
        with pytest.raises(BadInput, match=r"0001\.json: not a parameter snapshot"):
            Snapshot.from_json(wrong, "0001.json")
    assert json.loads(text)["format"] == FORMAT


def test_what_is_expected_is_what_was_left_there_last(snapshots: Snapshots) -> None:
    assert snapshots.expected() is None
    for held in (Held({"a": 1.0}, 1), HELD):
        snapshots.expect(held)
        assert snapshots.expected() == held


def test_a_machine_never_changed_holds_its_drawing_and_compensates_nothing(lab: Lab) -> None:
    lab.controller.held["backlash.leg1"] = 0.0
    assert compared(lab).values == lab.controller.held
    lab.controller.held["backlash.leg1"] = 0.01
    with pytest.raises(ParameterError, match=r"backlash\.leg1 = 0\.01 where .* 0\.0 \(1 of"):
        compared(lab)


def test_the_set_last_left_there_is_expected_and_not_the_drawing(lab: Lab) -> None:
    drawing = dict(lab.controller.held)
    lab.controller.held["leg2.L0"] += 0.25
    known_of(lab).expect(compared(lab, lab.controller.held))
    assert compared(lab).values["leg2.L0"] == drawing["leg2.L0"] + 0.25
    lab.controller.held = drawing
    with pytest.raises(ParameterError, match=r"leg2\.L0 .*\(1 of"):
        compared(lab)


def test_a_set_with_another_checksum_than_was_left_is_refused(lab: Lab) -> None:
    held = compared(lab)
    known_of(lab).expect(Held(held.values, held.checksum ^ 1))
    with pytest.raises(ParameterError, match="checksum"):
        compared(lab)


async def test_what_reads_back_differently_is_named_first_of_all_and_counted(lab: Lab) -> None:
    wanted = {**lab.controller.held, "leg2.L0": 1.5, "leg4.B_x": 2.5, "leg5.B_x": 3.5}
    kept = await write_volatile(lab.session.station, Wanted(wanted))
    assert kept.values == wanted
    assert not lab.controller.enabled
    lab.controller.held |= {"leg4.B_x": 2.25, "leg5.B_x": 0.0}
    with pytest.raises(ParameterError) as error:
        await prove(lab.session.station, Wanted(wanted), "after writing")
    assert error.value.what == (
        f"leg4.B_x reads back as 2.25 after writing, 2.5 was written (2 of {len(wanted)} differ)"
    )


# the journal, as several see it


@pytest.mark.parametrize("name", ["a plain name", "100% #1?", "größe"])
def test_a_journal_is_watched_in_a_folder_of_any_name(tmp_path: Path, name: str) -> None:
    (tmp_path / name).mkdir()
    path = tmp_path / name / "journal.sqlite"
    journal = Journal(path)
    journal.set_meta("smrs", {"1": "3"})
    viewer = Journal(path, read_only=True)
    assert viewer.meta("smrs") == {"1": "3"}
    viewer.close()
    journal.close()


def test_a_writer_waits_while_another_holds_the_journal(tmp_path: Path) -> None:
    """A backup or a viewer may lock the file for a moment; a reading is not lost by that."""
    path = tmp_path / "journal.sqlite"
    journal = Journal(path)
    other = sqlite3.connect(path, isolation_level=None, check_same_thread=False)
    other.execute("BEGIN IMMEDIATE")
    release = threading.Timer(0.3, other.execute, ["COMMIT"])
    release.start()
    journal.note("remark", "after the other", 1.0, "now")
    release.join()
    assert journal.notes() == [(1.0, "remark", "after the other")]
    other.close()
    journal.close()


def test_nests_that_were_asked_for_are_seen_in_order_and_no_others(tmp_path: Path) -> None:
    journal = Journal(tmp_path / "journal.sqlite")
    for k, nest in enumerate(("b1", "3", "b2", "b1")):
        row = NewRow("reading", float(k), "", (), nest, (float(k), 0.0, 0.0), (1e-6,) * 6)
        journal.add_row(f"step-{k}", 1, "now", row)
    refused = NewRow("reading", 9.0, "", (), "b1", (9.0, 0.0, 0.0), status="rejected", why="off")
    journal.add_row("step-9", 1, "now", refused)
    assert journal.seen(["b1", "b2", "b3"]) == {
        "b1": [(0.0, 0.0, 0.0), (3.0, 0.0, 0.0)], "b2": [(2.0, 0.0, 0.0)],
    }  # fmt: skip
    journal.close()
