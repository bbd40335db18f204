"""Answers do not hang on who gives them, nor on who dies meanwhile."""

import os
import signal
from pathlib import Path

import numpy as np
import pytest

import pkmcal
from app.jobs.fleet_folders import places_of
from app.jobs.fleet_machine import Asked, digest_of, fit_machine
from app.spread import spread
from calib.errors import BadInput
from tests.fleet.fleet_made import (
    always_killed,
    make_fleet,
    slowly,
    squared,
    squared_once_killed,
)


def test_a_process_that_dies_costs_no_answer(tmp_path: Path) -> None:
    questions = [(number, str(tmp_path / "died")) for number in range(6)]
    found = dict(spread(squared_once_killed, questions, workers=2))
    assert found == {number: number**2 for number in range(6)}
    assert (tmp_path / "died").exists()


def test_here_and_elsewhere_answers_are_the_same_and_none_are_asked_of_nobody() -> None:
    assert dict(spread(squared, [3, 4], workers=1)) == {0: 9, 1: 16}
    assert list(spread(squared, [], workers=2)) == []


@pytest.mark.long
def test_a_question_that_kills_who_is_asked_ends_in_words() -> None:
    with pytest.raises(BadInput, match="processes died"):
        list(spread(always_killed, [1, 2], workers=2))


def test_a_scheduler_that_is_not_there_is_said(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("app.spread.CONNECT_S", 0.5)
    with pytest.raises(BadInput, match=r"no Dask scheduler answers|Dask is not installed"):
        list(spread(squared, [1, 2], scheduler="tcp://127.0.0.1:1"))


@pytest.mark.long
def test_a_fleet_on_dask_is_that_of_processes_though_a_worker_is_killed(tmp_path: Path) -> None:
    distributed = pytest.importorskip("distributed", reason="Dask is not installed")
    folder = make_fleet(tmp_path / "fleet", 8)
    runs = [one.run for one in places_of(folder)[0]]
    asked = [Asked(run.folder.name, run, (), digest_of(run, ())) for run in runs]
    here = [fit_machine(one) for one in asked]
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None
    ) as cluster:
        there, killed = {}, False
        for number, answer in spread(slowly, asked, scheduler=cluster.scheduler_address):
            there[number] = answer
            if not killed:
                os.kill(cluster.workers[0].pid, signal.SIGKILL)
                killed = True
        whole = pkmcal.fit_fleet(folder, scheduler=cluster.scheduler_address).to_json()
    assert killed
    assert sorted(there) == list(range(8))
    for number, one in enumerate(here):
        np.testing.assert_allclose(there[number].values, one.values, rtol=1e-9, atol=1e-12)
        assert there[number].chi2 == pytest.approx(one.chi2, rel=1e-9)
    alone = pkmcal.fit_fleet(folder, workers=1).to_json()
    assert [one["name"] for one in whole["machines"]] == [one["name"] for one in alone["machines"]]
    np.testing.assert_allclose(
        [one["mean"] for one in whole["parameters"]],
        [one["mean"] for one in alone["parameters"]],
        rtol=1e-6, atol=1e-9,
    )  # fmt: skip
