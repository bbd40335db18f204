"""kill -9 at any moment, then resume: nothing measured is lost, nothing is counted twice."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from session_mock import POSES, Mock

from app.files.pose_table import poses_text
from app.session.journal import Journal

pytestmark = pytest.mark.long


def command(*arguments: str) -> list[str]:
    return [sys.executable, "-c", "from app.cli import main; main()", *arguments]


def start(arguments: list[str], folder: Path) -> "subprocess.Popen[bytes]":
    return subprocess.Popen(
        command(*arguments), cwd=folder, env=os.environ, stderr=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
    )  # fmt: skip


def good_readings(session: Path) -> list[tuple[str, str]]:
    journal = Journal(session / "journal.sqlite", read_only=True)
    try:
        return [(r.step, r.nest) for r in journal.rows() if r.kind == "reading"]
    finally:
        journal.close()


@pytest.mark.parametrize("readings", [0, 3, 9])
def test_a_killed_measurement_goes_on(
    mock_of: Callable[..., Mock], tmp_path: Path, readings: int
) -> None:
    mock = mock_of("--smrs", "3")
    site = mock.site_file(tmp_path)
    poses = tmp_path / "poses.csv"
    poses.write_text(poses_text({k: POSES[k] for k in "abc"}), encoding="utf-8")
    arguments = ["measure", "--site", str(site), "--poses", str(poses), "--no-warm-up"]
    process = start([*arguments, "--json"], tmp_path)
    deadline = time.monotonic() + 60.0
    while time.monotonic() < deadline and process.poll() is None:
        sessions = list((tmp_path / "sessions").glob("2*/journal.sqlite"))
        if sessions and len(good_readings(sessions[0].parent)) >= readings:
            break
        time.sleep(0.005)
    process.send_signal(signal.SIGKILL)
    process.wait()
    session = next((tmp_path / "sessions").glob("2*/journal.sqlite")).parent
    before = good_readings(session)
    again = subprocess.run(
        command("resume", str(session), "--json"), cwd=tmp_path, capture_output=True, timeout=100,
    )  # fmt: skip
    assert again.returncode == 0, again.stderr.decode()
    assert json.loads(again.stdout)["readings"] == 3 * 3 + 4 + 4
    after = good_readings(session)
    assert after[: len(before)] == before
    assert len(set(after)) == len(after) == 17
