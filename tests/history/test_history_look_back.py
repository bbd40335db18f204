"""Looking back: sessions and their logs, changes beyond chance, drifts and forecasts."""

import json
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from app.cli import pkmcal
from app.files.site import parse_site
from app.history.store import Entry, History
from app.jobs.listing import list_sessions, session_log
from app.jobs.looking_back import history_of
from app.session.folder import make_folder
from app.session.happenings import Following
from app.session.journal import IDENTITIES, Journal
from app.session.plans import PlanOptions, measure_plan
from calib.trend import change, drift, family_wise
from tests.answers import faults_of
from tests.tui.tui_stream import SITE

POSES = {"a": (5.0, 0.0, 222.0, 0.05, 0.0, 0.1), "b": (-6.0, 4.0, 216.0, 0.0, 0.06, -0.1)}


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with one session that came to its third step, and five calibrations."""
    folder = tmp_path_factory.mktemp("lab")
    site = parse_site(SITE, "site.toml", folder)
    plan = measure_plan(site, POSES, PlanOptions(title="first try"))
    journal = Journal(make_folder(folder, site, plan) / "journal.sqlite")
    journal.set_meta(IDENTITIES, {"controller": {"serial": "1001"}})
    for number, step in enumerate(plan.steps[:3]):
        utc = f"2026-11-29T06:00:0{number}.000+00:00"
        journal.started(step.id, 1, float(number), utc)
        journal.done(step.id, 1, float(number), utc, {})
    journal.note("answer", "done", 3.0, "2026-11-29T06:00:03.000+00:00")
    journal.close()
    calibrated(folder, 30.4375)
    return folder


def calibrated(folder: Path, apart_days: float) -> None:
    """Five calibrations; leg 3 moves on from each to the next, leg 1 before the last."""
    generator = np.random.default_rng(12)
    begun = datetime(2026, 1, 5, tzinfo=UTC)
    for month in range(5):
        values = {"leg1.L0": 230.72, "leg3.L0": 230.8 + 0.03 * month}
        if month == 4:
            values["leg1.L0"] += 0.06
        parameters = [
            {"name": n, "value": v + generator.normal(0.0, 0.004), "sigma": 0.004, "unit": "mm"}
            for n, v in values.items()
        ]
        said = {"runs": [f"run{month}"], "effects": [], "rms_um": 6.0, "parameters": parameters}
        utc = (begun + timedelta(days=apart_days * month)).isoformat()
        History(folder).add(Entry("fit", utc, "hexapod", "1001", f"run{month}", said))


def test_a_session_is_listed_with_how_far_it_came(root: Path) -> None:
    (one,) = list_sessions(root).sessions
    assert (one.state, one.machine, one.serial) == ("begun", "hexapod", "1001")
    assert one.title == "first try"
    assert (one.done, one.poses) == (3, 2)


def test_the_log_is_told_by_the_clock(root: Path) -> None:
    found = session_log(None, folder=root)
    assert [entry.kind for entry in found.entries] == [*["started", "done"] * 3, "answer"]
    assert found.entries[-1].utc == "2026-11-29T06:00:03.000+00:00"


def test_a_session_is_followed_while_it_goes_on(tmp_path: Path) -> None:
    site = parse_site(SITE, "site.toml", tmp_path)
    plan = measure_plan(site, POSES, PlanOptions())
    folder = make_folder(tmp_path, site, plan)
    followed, journal = Following(folder), Journal(folder / "journal.sqlite")
    assert followed.news() == []
    journal.started(plan.steps[0].id, 1, 0.0, "2026-11-29T06:00:00.000+00:00")
    journal.note("alarm", "tracker: cold", 0.0, "2026-11-29T06:00:01.000+00:00")
    assert [one.kind for one in followed.news()] == ["started", "alarm"]
    assert followed.news() == []
    journal.done(plan.steps[0].id, 1, 2.0, "2026-11-29T06:00:02.000+00:00", {})
    assert [one.text for one in followed.news()] == [plan.steps[0].says]
    assert (followed.facts.state, followed.facts.done) == ("begun", 1)
    journal.set_meta("finished_utc", "2026-11-29T06:00:03+00:00")
    journal.close()
    # Once where the answer is kept, once as a terminal would have it, with its bar.
    for kind in ({}, {"FORCE_COLOR": "1"}):
        said = CliRunner().invoke(pkmcal, ["attach", str(folder)], env=kind)
        assert said.exit_code == 0, said.exception
        assert plan.steps[0].says in said.output
        assert "finished" in said.output


def test_what_changed_more_than_chance_is_named_and_a_drift_has_its_forecast(root: Path) -> None:
    (machine,) = history_of(root).machines
    known = {one.name: one for one in machine.parameters}
    assert known["leg1.L0"].changed
    assert known["leg1.L0"].change == pytest.approx(0.06, abs=0.02)
    moving = known["leg3.L0"].drift
    assert moving is not None
    assert moving.clear
    assert moving.rate == pytest.approx(0.03, abs=4 * moving.sigma)
    # The machine's file allows 0.3 mm about 230.715.
    assert moving.months == pytest.approx((231.015 - 230.92) / 0.03, abs=1.0)


def test_what_an_afternoon_shows_is_called_no_drift(tmp_path: Path) -> None:
    calibrated(tmp_path, 0.1)
    (machine,) = history_of(tmp_path).machines
    assert {one.name: one.drift for one in machine.parameters} == {
        "leg1.L0": None, "leg3.L0": None,
    }  # fmt: skip
    assert {one.name: one.changed for one in machine.parameters}["leg1.L0"]


def test_runs_that_are_fitted_together_as_well_are_no_calibration_more(tmp_path: Path) -> None:
    calibrated(tmp_path, 30.0)
    alone = history_of(tmp_path)
    history = History(tmp_path)
    last = history.entries("fit")[-1]
    said = {**last.said, "runs": ["run3", "run4"]}
    history.add(Entry("fit", "2026-08-01T00:00:00+00:00", "hexapod", "1001", "both", said))
    both = history_of(tmp_path)
    assert both.machines[0].parameters == alone.machines[0].parameters
    assert len(both.machines[0].events) == len(alone.machines[0].events) + 1


@pytest.mark.parametrize("verb", ["sessions", "log", "history"])
def test_the_verbs_answer_by_their_schemas_and_in_words(root: Path, verb: str) -> None:
    asked = CliRunner().invoke(pkmcal, [verb, "--folder", str(root), "--json"])
    assert faults_of(json.loads(asked.stdout)) == []
    words = CliRunner().invoke(pkmcal, [verb, "--folder", str(root)]).stdout
    assert {"sessions": "first try", "log": "answer", "history": "a month"}[verb] in words


def test_nothing_is_called_a_change_among_many_that_stay() -> None:
    generator = np.random.default_rng(3)
    called = 0
    for _ in range(200):
        pairs = generator.standard_normal((60, 2))
        called += any(change((a, 1.0), (b, 1.0), 60).clear for a, b in pairs)
    assert 1 <= called <= 22  # 5 % of 200, and what chance makes of it (p below 1e-3)


def test_a_line_through_steady_values_is_no_drift() -> None:
    generator = np.random.default_rng(4)
    called = 0
    for _ in range(200):
        series = 7.0 + generator.standard_normal((20, 5))
        lines = [drift(range(5), values, [1.0] * 5, 20) for values in series]
        called += any(line is not None and line.clear for line in lines)
    assert called <= 22


def test_two_points_are_no_line() -> None:
    assert drift([0.0, 1.0], [0.0, 1.0], [0.1, 0.1], 1) is None


@pytest.mark.parametrize("z", [0.0, 1.0, 4.0, 9.0])
def test_many_looks_are_paid_for(z: float) -> None:
    alone, among = family_wise(z, 1), family_wise(z, 50)
    assert alone <= among <= min(1.0, 50 * alone) + 1e-12
