"""Write-backs killed (kill -9) at random moments: is a mixed set noticed, and never moved with?

    python -m bench kill_writeback [--of apply | undo] [--whom program | mock | both]
        [--kills 50] [--seed 1] [--seconds 300] [--page]

A mock hexapod, and two sets of parameters that differ in every leg: they are applied, or brought
back by ``undo``, one after the other. Half of the kills come at any moment, half in or just after
what writes, reads back or stores. After each the program must go on, or refuse (exit code 3) and
name ``pkmcal undo``, which must come through in the end. The mock tells with which sets its motions
were begun: any but the two is a mix.
"""

import argparse
import contextlib
import json
import os
import queue
import random
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import dataclass, field
from pathlib import Path

from app.defaults import LIMITS
from app.files.machines import load_machine
from bench._reliability_page import Row, write_row
from bench.kill_resume import ALONE_S, Station, program
from mocks.control import ControlClient

LOOSE = ("tolerance", "chi2", "holdout", "condition", "uncertainty", "gain", "check-peak",
         "check-rms")  # fmt: skip
"""Gates that a set off the truth does not pass, which is not what is asked here."""
STAGES = {
    "apply": ("write", "read-back", "store", "reload"),
    "undo": ("snapshot", "write", "store"),
}
"""What the program says on its way, where a kill is worth most."""
LONGEST_S = {"apply": 12.0, "undo": 3.0}
AFTER_STAGE_S, MOST_TRIES = 0.4, 50


def fit_text(off_mm: float) -> str:
    """A saved fit: as drawn, but for the legs' lengths."""
    parameters = [
        {
            "name": p.name, "value": p.nominal + off_mm * p.name.endswith(".L0"),
            "sigma": 1e-3, "unit": p.unit, "nominal": p.nominal, "identified": True,
        }
        for p in load_machine("hexapod").parameters
    ]  # fmt: skip
    quality = {"chi2_per_dof": 1.0, "holdout_rms_um": 9.0, "holdout_floor_um": 9.0}
    return json.dumps({"format": "pkm-fit/1", "effects": [], "parameters": parameters, **quality})


class Ear:
    """What a process says on standard error, as it comes."""

    def __init__(self, process: "subprocess.Popen[bytes]") -> None:
        self.said: list[str] = []
        self._lines: queue.Queue[str] = queue.Queue()
        self._process = process
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self) -> None:
        assert self._process.stderr is not None
        for line in self._process.stderr:
            self.said.append(line.decode("utf-8", "replace"))
            self._lines.put(self.said[-1])

    def hears(self, stage: str, until: float) -> bool:
        """Whether a stage was told before that moment; False where the process ended too."""
        while time.monotonic() < until:
            with contextlib.suppress(queue.Empty):
                if stage in self._lines.get(timeout=0.02):
                    return True
            if not self._thread.is_alive() and self._lines.empty():
                return False
        return False

    def words(self) -> str:
        """All of it, once the process has ended."""
        self._thread.join(5.0)
        return "".join(self.said)


@dataclass
class Killer:
    """Runs the program and kills it, the station, or both, while there are kills left."""

    folder: Path
    station: Station
    dice: random.Random
    of: str
    whom: str
    left: int
    sets: set[str] = field(default_factory=set)
    """Checksums of the two sets."""
    noticed: int = 0
    mixed: int = 0

    def ask(self) -> dict[str, object]:
        """Which set the mock holds, and with which it was moved."""
        with ControlClient(self.station.control) as hands:
            return hands("sets")

    def judge(self) -> None:
        """No motion was begun with any but the two sets, once both are known."""
        if len(self.sets) < 2:
            return
        moved = self.ask()["moved_with"]
        assert isinstance(moved, dict)
        if mixed := set(moved) - self.sets:
            raise SystemExit(f"MOVED WITH A MIX: {mixed}, known are {self.sets}")

    def run(self, arguments: list[str], killed: bool) -> tuple[int | None, str]:
        """Exit code and words; no code where the program was killed."""
        process = subprocess.Popen(
            program(*arguments), cwd=self.folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE
        )
        ear = Ear(process)
        if killed and self.left and self._waits(process, ear):
            self.left -= 1
            if self.whom != "program":
                self.judge()
                self.station.kill()
            if self.whom != "mock":
                process.kill()
            code = self._ended(process, ear, (0, 3))
            if self.whom != "program":
                self.station.start()
            self.judge()
            return (None if self.whom != "mock" else code), ear.words()
        code = self._ended(process, ear, (0, 3, 5))
        self.judge()
        return code, ear.words()

    def _waits(self, process: "subprocess.Popen[bytes]", ear: Ear) -> bool:
        """Wait for the moment of the kill; False where the program came to its end before."""
        longest = self.dice.uniform(0.3, LONGEST_S[self.of])
        if self.dice.random() < 0.5:
            ear.hears(self.dice.choice(STAGES[self.of]), time.monotonic() + ALONE_S)
            longest = self.dice.uniform(0.0, AFTER_STAGE_S)
        with contextlib.suppress(subprocess.TimeoutExpired):
            process.wait(longest)
        return process.poll() is None

    def _ended(self, process: "subprocess.Popen[bytes]", ear: Ear, codes: tuple[int, ...]) -> int:
        try:
            code = process.wait(ALONE_S)
        except subprocess.TimeoutExpired:
            process.kill()
            raise SystemExit(f"HANGS: no end within {ALONE_S:g} s: {ear.words()}") from None
        words = ear.words()
        if code != -9 and (code not in codes or "Traceback" in words):
            raise SystemExit(f"the program ended with {code}: {words}")
        return code

    def back(self, number: int) -> None:
        """Undo until it comes through."""
        words = ["undo", "--site", "site.toml", "--to", str(number)]
        for _ in range(MOST_TRIES):
            code, _ = self.run(words, self.of == "undo")
            if code == 0:
                return
            if code is None:
                self.look()
        raise SystemExit("UNDO NEVER COMES THROUGH")

    def look(self) -> None:
        """After a kill the program knows the set that the controller holds, or refuses."""
        words = ["apply", "b.json", "--site", "site.toml", "--dry-run"]
        code, said = self.run([*words, "--limit", "tolerance=1e9"], False)
        whole = str(self.ask()["holds"]) in self.sets
        self.mixed += not whole
        if code == 3 and "pkmcal undo" in said:
            self.noticed += 1
        elif code == 3 or not whole:
            raise SystemExit(
                f"exit code {code}, the set is {'whole' if whole else 'A MIX'}: {said}"
            )

    def apply(self, fit: str, killed: bool) -> None:
        """Apply until the controller holds it; where the program refuses, undo first."""
        words = ["apply", fit, "--site", "site.toml", "--yes", "--unattended"]
        for gate in LOOSE:
            words += ["--limit", f"{gate}={max(LIMITS[gate], 1.0) * 1e6:g}"]
        while True:
            code, said = self.run(words, killed)
            if code == 0 or (code == 5 and "holds this fit already" in said):
                return
            if code == 5:
                raise SystemExit(f"a gate refused: {said}")
            if code == 3 and "pkmcal undo" in said:
                self.noticed += 1
                self.back(1)


def trial(killer: Killer, until: float) -> int:
    """Write-backs one after the other; how many came through."""
    killer.sets.add(str(killer.ask()["holds"]))
    (killer.folder / "a.json").write_text(fit_text(0.02), encoding="utf-8")
    (killer.folder / "b.json").write_text(fit_text(0.0), encoding="utf-8")
    killer.apply("a.json", False)
    killer.sets.add(str(killer.ask()["holds"]))
    killer.judge()
    if len(killer.sets) != 2:
        raise SystemExit(f"two sets were meant: {killer.sets}")
    jobs = 0
    while killer.left and time.monotonic() < until:
        jobs += 1
        if killer.of == "apply":
            killer.apply("ba"[(jobs - 1) % 2] + ".json", True)
        else:
            killer.back(1 + jobs % 2)
    return jobs


def main() -> None:
    """Run the bench."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--of", choices=tuple(LONGEST_S), default="apply")
    parser.add_argument("--whom", choices=("program", "mock", "both"), default="program")
    parser.add_argument("--kills", type=int, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--scale", type=float, default=600.0)
    parser.add_argument("--seconds", type=float, default=300.0)
    parser.add_argument("--page", action="store_true")
    options = parser.parse_args()
    begun = time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        os.environ["PKMCAL_STATE"] = str(folder / "state")
        station = Station(folder, options.scale)
        station.start()
        dice = random.Random(f"{options.seed} {options.of} {options.whom}")
        killer = Killer(folder, station, dice, options.of, options.whom, options.kills)
        try:
            jobs = trial(killer, begun + options.seconds)
        finally:
            station.stop()
    kills = options.kills - killer.left
    whom = {"program": "the program", "mock": "the mock", "both": "program and mock at once"}
    ran = f"{kills} kills in {jobs} times {options.of}, {whom[options.whom]}"
    says = f"moved with whole sets alone; {killer.noticed} times a set was refused, and undo named"
    if options.of == "undo":
        says += f"; {killer.mixed} of them were mixed"
    print(f"{ran}, {time.monotonic() - begun:.0f} s, seed {options.seed}: {says}")
    if options.page:
        command = f"kill_writeback --of {options.of} --whom {options.whom} --kills {options.kills}"
        write_row("kills", Row(f"{command} --seed {options.seed}", ran, says))


if __name__ == "__main__":
    sys.exit(main())
