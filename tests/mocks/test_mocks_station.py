"""A station as a process: it starts, announces itself, obeys the control socket, and ends."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from drivers.emscon import EmsconTracker
from drivers.errors import NoTarget
from mocks.control import ControlClient

SCALE = 200.0


def launch(*arguments: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "mocks.station", "hexapod", "--scale", str(SCALE), *arguments],
        stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip


def line_of(process: subprocess.Popen[str]) -> dict[str, Any]:
    assert process.stdout is not None
    line = process.stdout.readline()
    assert line, process.stderr.read() if process.stderr else ""
    found: dict[str, Any] = json.loads(line)
    return found


@pytest.fixture(scope="module")
def station() -> Iterator[dict[str, Any]]:
    process = launch("--json", "--seed", "6", "--until-stdin-closes")
    try:
        yield line_of(process)
    finally:
        process.communicate(timeout=10)


@pytest.fixture
def hands(station: dict[str, Any]) -> Iterator[ControlClient]:
    with ControlClient(station["control"]) as client:
        yield client


async def connected(station: dict[str, Any]) -> EmsconTracker:
    tracker = await EmsconTracker.connect(station["tracker"], time_scale=SCALE)
    await tracker.initialize()
    return tracker


def nest_seen(hands: ControlClient, station: dict[str, Any], nest: str) -> np.ndarray:
    """Where a nest is, tracker frame, from the truth."""
    truth = hands("truth", settled=True)
    x, y, z, rx, ry, rz = truth["frame"]
    from mocks.physics.pose import rotation_from_rpy

    base = np.array(station["site"]["nests"]["base"].get(nest, [0, 0, 0]), dtype=float)
    if nest in station["site"]["nests"]["platform"]:
        body = np.array(station["site"]["nests"]["platform"][nest])
        base = np.array(truth["position"]) + np.array(truth["rotation"]) @ body
    return np.asarray(rotation_from_rpy(rx, ry, rz) @ base + [x, y, z])


def test_announcement(station: dict[str, Any]) -> None:
    assert station["format"] == "pkm-mock/1"
    assert station["machine"] == "hexapod"
    assert station["can"].startswith("socket://127.0.0.1:")
    assert station["scale"] == SCALE
    assert station["site"]["hands"]["control"] == station["control"]
    assert station["site"]["tracker"]["serial"] == "390793"


async def test_one_smr_is_carried_from_nest_to_nest(
    station: dict[str, Any], hands: ControlClient
) -> None:
    tracker = await connected(station)
    try:
        for nest in ("3", "4", "5"):
            hands("carry", smr=1, nest=nest)
            where = nest_seen(hands, station, nest)
            await tracker.point_at((float(where[0]), float(where[1]), float(where[2])))
            reading = await tracker.measure(1.0)
            assert np.linalg.norm(reading.xyz - where) < 0.05
        empty = nest_seen(hands, station, "3")
        with pytest.raises(NoTarget):
            await tracker.point_at((float(empty[0]), float(empty[1]), float(empty[2])))
    finally:
        await tracker.close()


async def test_beam_follows_a_carried_smr_or_is_lost(
    station: dict[str, Any], hands: ControlClient
) -> None:
    hands("carry", nest="3")
    tracker = await connected(station)
    try:
        where = nest_seen(hands, station, "3")
        await tracker.point_at((float(where[0]), float(where[1]), float(where[2])))
        hands("carry", nest="4")
        reading = await tracker.measure(0.5)
        assert np.linalg.norm(reading.xyz - nest_seen(hands, station, "4")) < 0.05
        hands("carry", nest="5", follow=False)
        assert not (await tracker.state()).locked
    finally:
        await tracker.close()


def test_a_nest_holds_one_smr(hands: ControlClient) -> None:
    with pytest.raises(ValueError, match="nest b2 already holds base-b2"):
        hands("carry", nest="b2")
    with pytest.raises(ValueError, match='no nest "9"'):
        hands("carry", nest="9")


def test_misplaced_smr(hands: ControlClient) -> None:
    hands("fault", name="misplace:5")
    hands("carry", nest="4")
    assert hands("where")["places"]["smr1"] == "5"
    hands("carry", nest="4")
    assert hands("where")["places"]["smr1"] == "4"


async def test_swapped_smr_shows(station: dict[str, Any], hands: ControlClient) -> None:
    hands("carry", nest="4")
    hands("swap-smr", smr=1, off_mm=12.7)
    tracker = await connected(station)
    try:
        where = nest_seen(hands, station, "4")
        await tracker.point_at((float(where[0]), float(where[1]), float(where[2])))
        reading = await tracker.measure(0.5)
        assert np.linalg.norm(reading.xyz - where) == pytest.approx(12.7, abs=0.05)
    finally:
        hands("swap-smr", smr=1, off_mm=0.0)
        await tracker.close()


def test_payload_temperature_and_faults(hands: ControlClient) -> None:
    hands("payload", kg=4.0)
    hands("temperature", structure_C=27.0)
    hands("fault", name="drive-fault:3")
    assert hands("faults")["faults"] == ["drive-fault:3"]
    hands("clear")
    assert hands("faults")["faults"] == []
    with pytest.raises(ValueError, match="kg must be between"):
        hands("payload", kg=-1.0)


def test_what_cannot_be_done_is_said(hands: ControlClient) -> None:
    with pytest.raises(ValueError, match='what to "do" must be one of'):
        hands("dance")
    with pytest.raises(ValueError, match="needs 'nest'"):
        hands("carry")
    with pytest.raises(ValueError, match=r"leg must be 1\.\.6"):
        hands("stall", leg=7)


def test_time_runs_at_the_scale(hands: ControlClient) -> None:
    assert hands("time")["scale"] == SCALE
    assert hands("time")["time_s"] <= hands("time")["time_s"]


def test_truth_differs_from_nominal_and_by_seed(hands: ControlClient) -> None:
    truth = hands("truth")
    assert abs(truth["parameters"]["leg1.L0"] - 230.715) < 0.3
    assert 0.0 < np.linalg.norm(np.array(truth["position"]) - [0, 0, 220]) < 2.0


@pytest.mark.skipif(os.name == "nt", reason="POSIX signals")
@pytest.mark.parametrize("name", ["SIGTERM", "SIGINT"])
def test_ends_cleanly_on_a_signal(name: str) -> None:
    process = launch("--json")
    line_of(process)
    process.send_signal(getattr(signal, name))
    _, errors = process.communicate(timeout=10)
    assert (process.returncode, errors) == (0, "")


PARENT = """
import subprocess, sys, time
from app.again import command_of
mock = command_of("mock", "hexapod", "--json", "--until-stdin-closes")
station = subprocess.Popen(mock, stdin=subprocess.PIPE)
print(station.pid, flush=True)
time.sleep(60.0)
"""


@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs /proc")
def test_a_station_is_one_process_and_ends_with_a_program_that_is_killed() -> None:
    parent = subprocess.Popen([sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True)
    try:
        assert parent.stdout is not None
        pid = int(parent.stdout.readline())
        assert json.loads(parent.stdout.readline())["control"]
        # Nothing below it could be left behind when it is ended from outside.
        assert not Path(f"/proc/{pid}/task/{pid}/children").read_text().strip()
    finally:
        parent.kill()
    # It holds the other end of that pipe as long as it lives.
    assert parent.communicate(timeout=30.0)[0] == ""


@pytest.mark.long
def test_bad_input_ends_with_2(tmp_path: Path) -> None:
    hidden = tmp_path / "hidden.toml"
    hidden.write_text('[hidden]\n"backlash.leg9" = 0.01\n')
    for arguments in (("--hidden", str(hidden)), ("--truth", str(tmp_path / "none.toml"))):
        process = launch(*arguments)
        _, errors = process.communicate(timeout=20)
        assert process.returncode == 2
        assert errors.startswith("error: ")


def test_site_file_and_hidden_effects(tmp_path: Path) -> None:
    hidden, site = tmp_path / "hidden.toml", tmp_path / "site.toml"
    hidden.write_text('[hidden]\n"backlash.leg3" = 0.015\n[hidden.unknown]\n"bending.k" = 0.002\n')
    process = launch("--json", "--hidden", str(hidden), "--site", str(site), "--smrs", "3",
                     "--until-stdin-closes")  # fmt: skip
    found = line_of(process)
    assert found["site_file"] == str(site)
    assert 'format = "pkm-site/1"' in site.read_text()
    with ControlClient(found["control"]) as hands:
        assert hands("truth")["hidden"] == {"backlash.leg3": 0.015, "unknown.bending.k": 0.002}
        places = hands("where")["places"]
        assert [places[f"smr{i}"] for i in (1, 2, 3)] == ["3", "4", "5"]
    process.communicate(timeout=10)
    assert process.returncode == 0


@pytest.mark.long
def test_controller_with_a_memory_keeps_its_serial_number(tmp_path: Path) -> None:
    def serial(*arguments: str) -> str:
        process = launch("--json", "--seed", "9", "--until-stdin-closes", *arguments)
        found = line_of(process)["site"]["controller"]["serial"]
        process.communicate(timeout=10)
        return str(found)

    first, second = (str(tmp_path / name) for name in ("first.json", "second.json"))
    number = serial("--nvm", first)
    assert serial("--nvm", first) == number
    assert serial("--nvm", second) != number
    assert serial() != serial()


def told(*words: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "app", "mock", "do", *words],
        capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip


def test_a_person_at_the_command_line_reaches_the_station(
    station: dict[str, Any], hands: ControlClient, tmp_path: Path
) -> None:
    site = tmp_path / "site.toml"
    site.write_text(f'[hands]\ncontrol = "{station["control"]}"\n', encoding="utf-8")
    done = told(str(site), "carry", "nest=4", "follow=false")
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["ok"]
    assert "4" in hands("where")["places"].values()
    refused = told(station["control"], "payload", "kg=-3")
    assert refused.returncode == 2
    assert "kg must be between" in refused.stderr
