"""Measurements killed (kill -9) at random moments: is every reading there exactly once?

A mock station, sessions of six poses in three nests; each process is killed after a random time,
until it comes through, again and again until there were enough kills. After every kill what the
journal held must still be there in the same order; at the end of each session every planned
reading must be there once, and the exported run must load.
"""

import argparse
import json
import os
import random
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

from app.files.pose_table import poses_text
from app.files.runs import read_run
from app.session.folder import read_folder
from app.session.journal import Journal
from app.session.within import JOURNAL
from bench._reliability_page import Row, write_row

POSES = {
    "a": (5.0, 0.0, 222.0, 0.05, 0.0, 0.1),
    "b": (-6.0, 4.0, 216.0, 0.0, 0.06, -0.1),
    "c": (0.0, -7.0, 224.0, -0.05, 0.03, 0.05),
    "d": (7.0, 6.0, 218.0, 0.03, -0.06, -0.04),
    "e": (-4.0, -4.0, 226.0, 0.02, 0.02, 0.12),
    "f": (2.0, 3.0, 214.0, -0.04, -0.04, 0.0),
}
LONGEST_S = 4.0


def program(*arguments: str) -> list[str]:
    return [sys.executable, "-c", "from app.cli import main; main()", *arguments]


def held(folder: Path) -> list[tuple[str, float]]:
    """Good readings of a session: step and time."""
    journal = Journal(folder / JOURNAL, read_only=True)
    try:
        return [(row.step, row.time_s) for row in journal.rows() if row.kind == "reading"]
    finally:
        journal.close()


def steps_of(folder: Path, steps: Iterable[str]) -> list[object]:
    """What the log says of some steps."""
    journal = Journal(folder / JOURNAL, read_only=True)
    try:
        return [entry[2:] for entry in journal.log() if entry[2] in set(steps)]
    finally:
        journal.close()


def killed(arguments: list[str], folder: Path, after_s: float) -> bool:
    """Run the program, kill it after a time; False if it had come through before."""
    process = subprocess.Popen(
        program(*arguments), cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
    )
    try:
        _, said = process.communicate(timeout=after_s)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return True
    if process.returncode:
        raise SystemExit(f"the program ended with {process.returncode}: {said.decode()}")
    return False


def one_session(folder: Path, begin: list[str], dice: random.Random, kills_left: int) -> int:
    """Measure with kills until the session comes through; returns how many kills there were."""
    root = folder / "sessions"
    before: list[tuple[str, float]] = []
    kills = 0
    known = set(root.glob("2*"))
    session: Path | None = None
    while True:
        arguments = ["resume", str(session)] if session else begin
        patience = dice.uniform(0.3, LONGEST_S) if kills < kills_left else 120.0
        was_killed = killed(arguments, folder, patience)
        session = session or next(iter(set(root.glob("2*")) - known), None)
        kills += was_killed
        if session is not None:
            now = held(session)
            if now[: len(before)] != before:
                raise SystemExit(f"LOST: {session} held {before[-3:]}, now {now[-3:]}")
            before = now
        if not was_killed:
            break
    assert session is not None
    _, plan = read_folder(session)
    wanted = [step.id for step in plan.steps if step.kind.name in ("read", "reference")]
    if sorted(step for step, _ in before) != sorted(wanted):
        found = Counter(step for step, _ in before)
        lacking = {step: found[step] for step in {*wanted, *found} if found[step] != 1}
        raise SystemExit(f"NOT ONCE EACH: {session}: {lacking}; {steps_of(session, lacking)}")
    if sum(bool(nest) for nest in read_run(session / "run").run.nest) != len(wanted):
        raise SystemExit(f"THE RUN MISSES READINGS: {session}")
    return kills


def main() -> None:
    """Run the bench."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scale", type=float, default=300.0)
    parser.add_argument("--seconds", type=float, default=300.0)
    parser.add_argument("--page", action="store_true")
    options = parser.parse_args()
    until = time.monotonic() + options.seconds
    dice = random.Random(options.seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["PKMCAL_STATE"] = str(folder / "state")
        (folder / "poses.csv").write_text(poses_text(POSES), encoding="utf-8")
        station = subprocess.Popen(
            [
                sys.executable, "-m", "mocks.station", "hexapod", "--smrs", "3", "--json",
                "--scale", str(options.scale), "--site", str(folder / "site.toml"),
                "--until-stdin-closes",
            ],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE,
        )  # fmt: skip
        assert station.stdin is not None
        assert station.stdout is not None
        json.loads(station.stdout.readline())
        begin = ["measure", "--site", "site.toml", "--poses", "poses.csv", "--unattended"]
        begun, kills, sessions = time.monotonic(), 0, 0
        try:
            while kills < options.kills and time.monotonic() < until:
                kills += one_session(folder, begin, dice, options.kills - kills)
                sessions += 1
        finally:
            station.stdin.close()
            station.wait(timeout=20)
            station.stdout.close()
    spent = time.monotonic() - begun
    ran, says = f"{kills} kills in {sessions} sessions", "nothing lost, nothing counted twice"
    print(f"{ran}, {spent:.0f} s, seed {options.seed}: {says}")
    if options.page:
        command = f"kill_resume --kills {options.kills} --seed {options.seed}"
        write_row("kills", Row(command, f"{ran} of measure and resume", says))


if __name__ == "__main__":
    main()
