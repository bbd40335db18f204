"""Deciding by itself against a fixed plan: readings spent, targets held, causes named.

    python -m bench auto [--worlds 100] [--target-um 8 3] [--seed 1] [--out FILE] [--minutes 5]
    python -m bench auto --wire 5 [--target-um 8] ...

Worlds are simulated by the mock's own physics: 0 to 3 hidden effects of the catalogue, at two
sqrt(3) sigma RMS each; every other four worlds have noise that is correlated from reading to
reading (0.3). In each the autopilot works until it stops, once for every target; the fixed plan
measures 40 poses once and discovers. The true error is that of noise-free readings at fresh poses
against the model, which none of them sees.

With --wire each world is a mock station in a process of its own, 1, 2, 3 and 0 effects hidden in
turn, under noise that is slow; ``pkmcal auto`` is another process and nobody answers it.
``machine_um`` is then the true error of the machine as it was left, by the station's own truth.

Every world is a line of FILE: the same command goes on where the last one was. No world is begun
after so many minutes.
"""

import argparse
import asyncio
import json
import os
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from app.auto.autopilot import Autopilot, Seen
from app.auto.decision import Limits
from app.auto.findings import Findings, fresh_poses, look
from app.auto.known import HOPELESS
from app.files.machines import load_machine
from app.files.pose_table import Pose
from app.jobs.posing import choose_poses
from app.jobs.predicting import predict
from bench._auto_wires import tried_on_wires
from bench._auto_worlds import (
    FIXED,
    FROM_COLD,
    HOURS,
    MACHINE,
    OF_THE_TRACKER,
    QUIET_MM,
    Came,
    World,
    draw,
    draw_for_wires,
    hidden_in,
    without,
)
from bench._blind_cases import NEXT_TO_NONE_MM, SIGMA_MM
from bench._blind_noise import noisy
from bench._intervals import median, share
from mocks.hidden.table import Hidden
from mocks.simulate.files import write
from mocks.simulate.plan import Profile, RunPlan
from mocks.simulate.run import simulate

MINUTES_A_POSE = 2.0


class SimulatedLaboratory:
    """Runs of one world, one after the other: the frame is another one in each.

    The machine is cold when the first begins; those that follow find it warm.
    """

    def __init__(self, world: World, hidden: Mapping[str, float], folder: Path) -> None:
        folder.mkdir()
        self.world, self.hidden, self.folder = world, dict(hidden), folder
        self.runs = 0
        self.parameters: Mapping[str, float] | None = None
        self.model: Path | None = None

    def run(
        self,
        poses: Mapping[str, Pose],
        noise_mm: float = SIGMA_MM,
        over: tuple[str, ...] = (),
    ) -> str:
        """Simulate a run at poses, effects of ``over`` being over."""
        self.runs += 1
        over += FROM_COLD if self.runs > 1 else ()
        plan = RunPlan(
            machine=MACHINE,
            # Another room and other noise in each run, the same machine.
            seed=self.world.seed + 1_000_000 * self.runs,
            poses=np.array(list(poses.values())),
            noise_mm=noise_mm,
            hidden=Hidden(without(self.hidden, over)),
            parameters=self.parameters,
            profile=Profile(rise_K=6.0, payload_kg=(0.0, 12.0)),
            prior="normal",
            delays=True,
        )
        made = simulate(plan)
        self.parameters = made.parameters
        if self.world.noise and noise_mm == SIGMA_MM:
            bare = simulate(replace(plan, parameters=made.parameters, noise_mm=NEXT_TO_NONE_MM))
            made = replace(made, xyz=noisy(bare, self.world.noise, SIGMA_MM, plan.seed))
        out = self.folder / f"run{self.runs}"
        write(made, out, self.folder / f"truth{self.runs}.json")
        return str(out)

    async def choose(self, count: int, seed: int) -> Mapping[str, Pose]:
        return choose_poses(MACHINE, count, candidates=300, seed=seed).by_label()

    async def measure(
        self, poses: Mapping[str, Pose], title: str, began: Callable[[str], None], again: str | None
    ) -> tuple[str, float]:
        return self.run(poses), MINUTES_A_POSE * len(poses)

    async def warm_up(
        self, minutes: float, began: Callable[[str], None], again: str | None
    ) -> float:
        return minutes  # after its first run the machine is warm

    async def apply(self, model: Path) -> Mapping[str, str]:
        self.model = model
        return {}

    async def verify(self, began: Callable[[str], None], again: str | None) -> Seen:
        assert self.model is not None
        poses = fresh_poses(load_machine(MACHINE))
        seen = predict(self.model, self.run(poses), frame=True)
        assert seen.rms_um is not None
        assert seen.noise_um is not None
        own = float(np.sqrt(max(seen.rms_um**2 - seen.noise_um**2, 0.0)))
        return Seen(own, own, MINUTES_A_POSE * len(poses))

    def true_um(self, model: Path) -> float:
        """RMS of what the model does not know of noise-free readings at fresh poses.

        A tracker that stands still reads them, on a warm machine.
        """
        run = self.run(fresh_poses(load_machine(MACHINE)), QUIET_MM, OF_THE_TRACKER)
        return float(predict(model, run, frame=True).rms_um or np.nan)


def tried(world: World, targets_um: Sequence[float]) -> dict[str, Came]:
    """The autopilot for each target, and the fixed plan, in one world."""
    hidden = hidden_in(world)
    with tempfile.TemporaryDirectory() as made:
        folder = Path(made)
        came = {
            f"{target:g}": _auto(SimulatedLaboratory(world, hidden, folder / f"{target:g}"), target)
            for target in targets_um
        }
        return {**came, "fixed": _fixed(SimulatedLaboratory(world, hidden, folder / "fixed"))}


def _auto(laboratory: SimulatedLaboratory, target_um: float) -> Came:
    pilot = Autopilot(laboratory.folder, laboratory, Limits(target_um, minutes=60.0 * HOURS))
    last = asyncio.run(pilot.run())
    done = pilot.journal.of("done")
    found = Findings.from_json(pilot.journal.of("found")[-1])
    left = {tuple(line["pair"]) for line in done if HOPELESS in line}
    return replace(
        _judged(laboratory, found, sum(int(line.get("poses", 0)) for line in done)),
        proof=3 * len(fresh_poses(load_machine(MACHINE)))
        * sum("verified_um" in line for line in done),
        open=len(left & set(found.ambiguous)),
        reached=last.reached,
    )  # fmt: skip


def _fixed(laboratory: SimulatedLaboratory) -> Came:
    run = laboratory.run(asyncio.run(laboratory.choose(FIXED, 1)))
    return _judged(laboratory, look((run,), laboratory.folder / "model.toml"), FIXED)


def _judged(laboratory: SimulatedLaboratory, found: Findings, poses: int) -> Came:
    hidden, named = set(laboratory.world.effects), set(found.effects)
    return Came(
        3 * poses, 0, laboratory.true_um(Path(found.model)), hidden <= named, len(named - hidden),
        len(found.ambiguous),
    )  # fmt: skip


def read(file: Path) -> dict[int, dict[str, Came]]:
    """Worlds that were tried already, by their seeds."""
    if not file.exists():
        return {}
    lines = map(json.loads, file.read_text(encoding="utf-8").splitlines())
    return {
        line["seed"]: {way: Came(**came) for way, came in line["came"].items()} for line in lines
    }


def table(came: Sequence[Mapping[str, Came]], targets_um: Sequence[float]) -> list[str]:
    """Rows over all worlds; in brackets the 95 % interval."""
    ways = [*(f"{target:g}" for target in targets_um), "fixed"]
    heads = [*(f"decides by itself, {target:g} um" for target in targets_um), f"{FIXED} poses"]
    lines = ["| | " + " | ".join(heads) + " |", "|---" * (1 + len(ways)) + "|"]
    rows: dict[str, Callable[[Sequence[Came]], str]] = {
        "readings for the fit, median": lambda all_: median([c.readings for c in all_]),
        "readings to prove it, median": lambda all_: median([c.proof for c in all_]),
        "true error, um, median": lambda all_: median([c.true_um for c in all_]),
        "all hidden effects named": lambda all_: share([c.named for c in all_]),
        "nothing else named": lambda all_: share([not c.false_names for c in all_]),
        "a pair is left in question": lambda all_: share([c.open > 0 for c in all_]),
        "says that the target holds": lambda all_: share([c.reached for c in all_]),
    }
    for says, of in rows.items():
        cells = [of([one[way] for one in came]) for way in ways]
        lines.append(f"| {says} | " + " | ".join(cells) + " |")
    for target in targets_um:
        cells = [share([one[way].true_um <= target for one in came]) for way in ways]
        lines.append(f"| true error within {target:g} um | " + " | ".join(cells) + " |")
    return lines


def by_kind(worlds: Sequence[World], done: Mapping[int, Mapping[str, Came]]) -> list[str]:
    """Names by the number of hidden effects and by the noise."""
    ways = list(next(iter(done.values())))
    lines = [
        "| hidden, noise | worlds | " + " | ".join(ways) + " |",
        "|---" * (2 + len(ways)) + "|",
    ]
    for noise in dict.fromkeys(world.noise for world in worlds):
        for count in range(4):
            here = [
                done[w.seed] for w in worlds
                if w.seed in done and (len(w.effects), w.noise) == (count, noise)
            ]  # fmt: skip
            right = (
                f"{sum(one[way].named and not one[way].false_names for one in here)}"
                for way in ways
            )
            if not here:
                continue
            kind = f"{count}, {noise or 'white'}"
            lines.append(f"| {kind} | {len(here)} | " + " | ".join(right) + " |")
    return lines


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", type=int, default=100)
    parser.add_argument("--wire", type=int, metavar="N", help="N worlds on the wire instead")
    parser.add_argument("--target-um", type=float, nargs="+", default=[8.0, 3.0])
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--out", type=Path)
    parser.add_argument("--minutes", type=float, default=np.inf)
    options = parser.parse_args()
    worlds = (
        draw_for_wires(options.wire, options.seed)
        if options.wire
        else draw(options.worlds, options.seed)
    )
    judged = tried_on_wires if options.wire else tried
    done = read(options.out) if options.out else {}
    began = time.monotonic()
    for world in worlds:
        if world.seed in done or time.monotonic() - began > 60.0 * options.minutes:
            continue
        done[world.seed] = judged(world, options.target_um)
        if options.out:
            came = {way: asdict(one) for way, one in done[world.seed].items()}
            with options.out.open("a", encoding="utf-8") as file:
                file.write(json.dumps({"seed": world.seed, "came": came}) + "\n")
    here = [done[world.seed] for world in worlds if world.seed in done]
    print("\n".join(table(here, options.target_um)))
    print(f"\n{len(here)} of {len(worlds)} worlds; named rightly and nothing else:\n")
    print("\n".join(by_kind(worlds, done)))


if __name__ == "__main__":
    main()
