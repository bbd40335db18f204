"""How far a calibration has come: as found stays so, a new run begins anew, all is recalled."""

from datetime import UTC, datetime, timedelta
from itertools import count
from pathlib import Path

import pytest
import tui_stream as stream

from app.files.site import parse_site
from app.history.store import Entry, History
from app.report.issued import issued_for, note_issued
from app.session.folder import make_folder
from app.session.journal import IDENTITIES, Journal
from app.session.plan import Plan
from app.session.plans import PlanOptions, measure_plan
from app.tui.course import Course
from app.tui.picture import Picture
from app.tui.standing import Standing, standing_of
from app.tui.study import Study
from app.verification import verification_plan

POSES = {"a": (5.0, 0.0, 222.0, 0.05, 0.0, 0.1)}
SERIAL = "1001"


@pytest.fixture
def course(tmp_path: Path) -> Course:
    picture = Picture()
    return Course(tmp_path, picture, Study(tmp_path, picture))


def test_what_is_verified_again_does_not_become_what_the_machine_was_found_as(
    course: Course,
) -> None:
    found, left, again = (stream.verified(um, seed) for seed, um in enumerate((600.0, 5.0, 6.0)))
    course.take(found)
    course.written()
    course.take(left)
    assert (course.before, course.after) == (found, left)
    course.take(again)
    assert (course.before, course.after) == (found, again)


def test_a_new_run_begins_a_round_whose_as_found_is_what_was_left(course: Course) -> None:
    found, left, last = (stream.verified(um, seed) for seed, um in enumerate((600.0, 5.0, 4.0)))
    course.take(found)
    course.measured(Path("sessions/one/run"))
    course.written()
    course.take(left)
    course.done.add("record")
    course.measured(Path("sessions/two/run"))
    assert course.done == {"found"}
    course.written()
    course.take(last)
    assert (course.before, course.after) == (left, last)


def test_what_was_written_and_put_back_again_is_not_done(course: Course) -> None:
    course.take(stream.verified(600.0, 1))
    course.written()
    course.take(stream.verified(5.0, 2))
    course.undone()
    assert course.done == {"found"}


class Folder:
    """A folder of sessions to which things happen one after the other."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.site = parse_site(stream.SITE, "site.toml", root)
        self._hours = count()
        self._sets = count(2)

    def _now(self) -> str:
        begun = datetime(2026, 11, 1, tzinfo=UTC)
        return (begun + timedelta(hours=next(self._hours))).isoformat()

    def session(self, plan: Plan) -> Path:
        folder = make_folder(self.root, self.site, plan)
        journal = Journal(folder / "journal.sqlite")
        journal.set_meta(IDENTITIES, {"controller": {"serial": SERIAL}})
        journal.set_meta("finished_utc", self._now())
        journal.close()
        return folder

    def measured(self) -> Path:
        return self.session(measure_plan(self.site, POSES, PlanOptions()))

    def verified(self) -> Path:
        return self.session(verification_plan(self.site, POSES, truth=False))

    def written(self) -> int:
        number = next(self._sets)
        History(self.root).add(
            Entry("applied", self._now(), "hexapod", SERIAL, "model.toml", {"set": number})
        )
        return number


def test_a_calibration_is_gone_on_with_where_the_program_was_left(tmp_path: Path) -> None:
    lab = Folder(tmp_path)
    found = lab.verified()
    assert standing_of(tmp_path, SERIAL, None) == Standing(frozenset({"found"}), None, found)
    run = lab.measured()
    asked = standing_of(tmp_path, SERIAL, None)
    assert (asked.done, asked.run, asked.found) == ({"found"}, run / "run", found)
    used = lab.written()
    left = lab.verified()
    asked = standing_of(tmp_path, SERIAL, used)
    assert (asked.done, asked.found, asked.left) == ({"found", "applied", "left"}, found, left)
    # Another set is in use: it was put back, or somebody else has written.
    assert "applied" not in standing_of(tmp_path, SERIAL, used + 1).done
    assert standing_of(tmp_path, "another machine", used) == Standing()


def test_a_calibration_whose_record_is_written_is_over(tmp_path: Path) -> None:
    lab = Folder(tmp_path)
    lab.verified()
    run = lab.measured() / "run"
    used, left = lab.written(), lab.verified()
    note_issued("20261101-1", (str(run),), (tmp_path / "record.pdf",))
    assert len(issued_for(tmp_path, run.parent.name)) == 1
    assert standing_of(tmp_path, SERIAL, used) == Standing(left=left)
    again = lab.measured()
    asked = standing_of(tmp_path, SERIAL, used)
    assert (asked.done, asked.run, asked.found) == ({"found"}, again / "run", left)
