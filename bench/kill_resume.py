"""Jobs killed (kill -9) at random moments: is every reading there exactly once?

    python -m bench kill_resume [--kills 50] [--seed 1] [--of measure | verify | auto | mock | both]

A mock station, sessions of six poses in three nests; each process is killed after a random time,
until it comes through, again and again until there were enough kills. After every kill what the
journal held must still be there in the same order; at the end of each session every planned
reading must be there once, and the exported run must load. ``verify``: its answer must be there as
well. ``auto``: every decision too, and none is taken twice. ``mock``: the station is killed and
started anew while a measurement runs, which must end by itself, with a typed fault (exit code 3);
``both``: program and station at one moment.
"""

import argparse
import contextlib
import json
import os
import random
import socket
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from app.auto.journal import Decisions
from app.files.pose_table import poses_text
from app.files.runs import read_run
from app.jobs.verifying import VERDICT
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
HOST = "127.0.0.1"
LONGEST_S = {"measure": 4.0, "verify": 4.0, "auto": 20.0, "mock": 4.0, "both": 4.0}
"""Until a kill at the latest, by what is killed."""
SAID = {
    "mock": "the mock in sessions of measure",
    "both": "program and mock at once in sessions of measure",
}
ALONE_S = 150.0


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


def ended(process: "subprocess.Popen[bytes]", within_s: float, codes: tuple[int, ...]) -> int:
    """The exit code of a program that ends by itself; anything but these codes is a finding."""
    try:
        _, said = process.communicate(timeout=within_s)
    except subprocess.TimeoutExpired:
        process.kill()
        raise SystemExit(f"HANGS: no end within {within_s:g} s") from None
    words = said.decode("utf-8", "replace")
    if process.returncode not in codes or "Traceback" in words:
        raise SystemExit(f"the program ended with {process.returncode}: {words}")
    return process.returncode


class Station:
    """A mock at ports of its own, which may be killed and started anew with the same memory."""

    def __init__(self, folder: Path, scale: float) -> None:
        self._folder = folder
        with contextlib.ExitStack() as stack:
            taken = [stack.enter_context(socket.create_server((HOST, 0))) for _ in range(3)]
            ports = [str(one.getsockname()[1]) for one in taken]
        self.control = f"{HOST}:{ports[2]}"
        """Where its back door is."""
        names = ("--controller-port", "--tracker-port", "--control-port")
        self._command = [
            sys.executable, "-m", "mocks.station", "hexapod", "--smrs", "3", "--json",
            "--scale", str(scale), "--site", str(folder / "site.toml"), "--until-stdin-closes",
            "--nvm", str(folder / "memory.json"),
            *[word for pair in zip(names, ports, strict=True) for word in pair],
        ]  # fmt: skip
        self._process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Switch it on."""
        pipe = subprocess.PIPE
        self._process = subprocess.Popen(self._command, stdin=pipe, stdout=pipe)
        assert self._process.stdout is not None
        json.loads(self._process.stdout.readline())

    def kill(self) -> None:
        """The end without a word."""
        assert self._process is not None
        self._process.kill()
        self._process.communicate()

    def stop(self) -> None:
        """Switch it off."""
        assert self._process is not None
        self._process.communicate(timeout=20)


@dataclass
class Killer:
    """Runs programs in a folder and kills them, or the station, while there are kills left."""

    folder: Path
    station: Station
    dice: random.Random
    left: int
    of: str

    def comes_through(self, arguments: list[str]) -> bool:
        """Run the program; whether it came to its end. With kills left it may be killed."""
        process = subprocess.Popen(
            program(*arguments), cwd=self.folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
        )
        if not self.left:
            ended(process, ALONE_S, (0,))
            return True
        after_s = self.dice.uniform(0.3, LONGEST_S[self.of])
        try:
            _, said = process.communicate(timeout=after_s)
        except subprocess.TimeoutExpired:
            self.left -= 1
            if self.of == "mock":
                self.station.kill()
                code = ended(process, ALONE_S, (0, 3))
                self.station.start()
                return code == 0
            if self.of == "both":
                self.station.kill()
            process.kill()
            process.communicate()
            if self.of == "both":
                self.station.start()
            return False
        if process.returncode:
            raise SystemExit(f"the program ended with {process.returncode}: {said.decode()}")
        return True


def one_session(killer: Killer, begin: list[str]) -> None:
    """A session with kills until it comes through."""
    root = killer.folder / "sessions"
    before: list[tuple[str, float]] = []
    known = set(root.glob("2*"))
    session: Path | None = None
    through = False
    while not through:
        through = killer.comes_through(["resume", str(session)] if session else begin)
        session = session or next(iter(set(root.glob("2*")) - known), None)
        if session is not None:
            now = held(session)
            if now[: len(before)] != before:
                raise SystemExit(f"LOST: {session} held {before[-3:]}, now {now[-3:]}")
            before = now
    assert session is not None
    must_be_whole(session)
    if killer.of == "verify":
        said = json.loads((session / VERDICT).read_text("utf-8"))
        if said["poses"] != len(POSES):
            raise SystemExit(f"THE ANSWER MISSES POSES: {session}: {said['poses']}")


def one_flight(killer: Killer, number: int) -> None:
    """An autopilot with kills until it comes to its end: no decision lost, none taken twice."""
    folder = killer.folder / f"auto-{number}"
    begin = ["auto", "--site", "site.toml", "--target-um", "25", "--first", "12", "--hours", "4"]
    begin += ["--out", str(folder), "--unattended"]
    before: list[object] = []
    through = False
    while not through:
        through = killer.comes_through(begin)
        now: list[object] = list(Decisions(folder).lines) if folder.exists() else []
        if now[: len(before)] != before:
            raise SystemExit(f"LOST: {folder} held {before[-1]}, now {now[-1:]}")
        before = now
    numbers = [line["number"] for line in Decisions(folder).of("decided")]
    if numbers != list(range(1, len(numbers) + 1)):
        raise SystemExit(f"DECISIONS NOT ONCE EACH: {folder}: {numbers}")
    for session in (folder / "sessions").glob("2*"):
        must_be_whole(session)


def must_be_whole(session: Path) -> None:
    """Every planned reading is there once, in the journal and in the run."""
    _, plan = read_folder(session)
    wanted = [step.id for step in plan.steps if step.kind.name in ("read", "reference")]
    there = [step for step, _ in held(session)]
    if sorted(there) != sorted(wanted):
        found = Counter(there)
        lacking = {step: found[step] for step in {*wanted, *found} if found[step] != 1}
        raise SystemExit(f"NOT ONCE EACH: {session}: {lacking}; {steps_of(session, lacking)}")
    if sum(bool(nest) for nest in read_run(session / "run").run.nest) != len(wanted):
        raise SystemExit(f"THE RUN MISSES READINGS: {session}")


def main() -> None:
    """Run the bench."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--of", choices=tuple(LONGEST_S), default="measure")
    parser.add_argument("--scale", type=float, default=300.0)
    parser.add_argument("--seconds", type=float, default=300.0)
    parser.add_argument("--page", action="store_true")
    options = parser.parse_args()
    until = time.monotonic() + options.seconds
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["PKMCAL_STATE"] = str(folder / "state")
        (folder / "poses.csv").write_text(poses_text(POSES), encoding="utf-8")
        station = Station(folder, options.scale)
        station.start()
        killer = Killer(folder, station, random.Random(options.seed), options.kills, options.of)
        verb = "verify" if options.of == "verify" else "measure"
        begin = [verb, "--site", "site.toml", "--poses", "poses.csv", "--unattended"]
        begun, jobs = time.monotonic(), 0
        try:
            while killer.left and time.monotonic() < until:
                jobs += 1
                if options.of == "auto":
                    one_flight(killer, jobs)
                else:
                    one_session(killer, begin)
        finally:
            station.stop()
    spent, kills = time.monotonic() - begun, options.kills - killer.left
    whom = SAID.get(options.of, options.of)
    what = "autopilots" if options.of == "auto" else "sessions"
    ran, says = f"{kills} kills in {jobs} {what}", "nothing lost, nothing counted twice"
    print(f"{ran}, {spent:.0f} s, seed {options.seed}: {says}")
    if options.page:
        command = f"kill_resume --of {options.of} --kills {options.kills} --seed {options.seed}"
        write_row("kills", Row(command, f"{ran}, {whom}", says))


if __name__ == "__main__":
    main()
