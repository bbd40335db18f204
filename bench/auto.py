"""Deciding by itself against a fixed plan: readings spent, targets held, causes named.

    python -m bench auto [--worlds 100] [--target-um 8] [--seed 1] [--workers 2]

Worlds are simulated by the mock's own physics: 0 to 3 hidden effects of the catalogue, at two
sqrt(3) sigma RMS each. In each the autopilot works until it stops; the fixed plan measures 40
poses once and discovers. The true error is that of noise-free readings at fresh poses against
the model, which neither of them sees.
"""

import argparse
import asyncio
import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from app.auto.autopilot import Autopilot, Seen
from app.auto.findings import fresh_poses
from app.auto.policy import Limits
from app.files.machines import load_machine
from app.files.pose_table import Pose, poses_text
from app.jobs.discovering import discover
from app.jobs.posing import choose_poses
from app.jobs.predicting import predict
from app.jobs.simulating import simulate
from bench._blind_cases import Case, build, drawn_on

MACHINE, FIXED, SIZE = "hexapod", 40, 2.0
MINUTES_A_POSE = 2.0
QUIET_UM = 0.05
"""Noise of the readings that tell the true error."""
OF_ONE_RUN = ("frame-shift", "actuator-step", "warm-up")
"""Events of one run: a world of several runs cannot hold them alike."""


@dataclass(frozen=True)
class World:
    """A machine with its hidden effects, and the seed of everything."""

    seed: int
    effects: tuple[str, ...]


@dataclass(frozen=True)
class Came:
    """What one way of measuring came to in one world."""

    readings: int
    true_um: float
    named: bool
    false_names: int
    stopped: str = ""


class SimulatedLaboratory:
    """Runs of one world; the frame is another one in each, as after a day."""

    def __init__(self, world: World, hidden: Mapping[str, float], folder: Path) -> None:
        self.world, self.hidden, self.folder = world, hidden, folder
        self.runs = 0
        self.model: Path | None = None

    def run(self, poses: Mapping[str, Pose], noise_um: float = 5.0) -> str:
        """Simulate a run at poses."""
        self.runs += 1
        table, run = self.folder / f"{self.runs}.csv", self.folder / f"run{self.runs}"
        table.write_text(poses_text(poses), encoding="utf-8")
        truth = self.folder / "truth.json"
        simulate(
            MACHINE,
            run,
            # Another room and other noise in each run, the same machine.
            seed=self.world.seed + 1_000_000 * self.runs,
            truth=truth if self.runs == 1 else self.folder / f"truth{self.runs}.json",
            parameters=truth if self.runs > 1 else None,
            poses=table,
            noise_um=noise_um,
            effects=dict(self.hidden),
            payload=(0.0, 12.0),
            delays=True,
        )
        return str(run)

    async def choose(self, count: int, seed: int) -> Mapping[str, Pose]:
        return choose_poses(MACHINE, count, candidates=300, seed=seed).by_label()

    async def measure(
        self, poses: Mapping[str, Pose], title: str, began: Callable[[str], None], again: str | None
    ) -> tuple[str, float]:
        return self.run(poses), MINUTES_A_POSE * len(poses)

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
        return Seen(own, float("nan"), MINUTES_A_POSE * len(poses))

    def true_um(self, model: Path) -> float:
        """RMS of what the model does not know of noise-free readings at fresh poses."""
        run = self.run(fresh_poses(load_machine(MACHINE)), QUIET_UM)
        return float(predict(model, run, frame=True).rms_um or np.nan)


def draw(count: int, seed: int) -> list[World]:
    """Worlds with 0 to 3 hidden effects in turn."""
    rng = np.random.default_rng(seed)
    names = [name for name in drawn_on(MACHINE, unknown=False) if name not in OF_ONE_RUN]
    return [
        World(seed * 10_000 + k, tuple(map(str, rng.choice(names, k % 4, replace=False))))
        for k in range(count)
    ]


def both(job: tuple[World, float]) -> tuple[Came, Came]:
    """The autopilot and the fixed plan in one world."""
    world, target_um = job
    case = Case(world.seed, world.effects, (SIZE,) * len(world.effects), "", machine=MACHINE)
    _, hidden = build(case, 40)
    with tempfile.TemporaryDirectory() as folder:
        return _auto(world, hidden, Path(folder) / "a", target_um), _fixed(
            world, hidden, Path(folder) / "b"
        )


def _auto(world: World, hidden: Mapping[str, float], folder: Path, target_um: float) -> Came:
    folder.mkdir()
    laboratory = SimulatedLaboratory(world, hidden, folder)
    pilot = Autopilot(folder, laboratory, Limits(target_um, minutes=6 * 60.0))
    last = asyncio.run(pilot.run())
    found = pilot.journal.of("found")[-1]
    poses = sum(int(line.get("poses", 0)) for line in pilot.journal.of("done"))
    return _judged(
        laboratory, Path(found["model"]), world, tuple(found["effects"]), poses, str(last.reached)
    )


def _fixed(world: World, hidden: Mapping[str, float], folder: Path) -> Came:
    folder.mkdir()
    laboratory = SimulatedLaboratory(world, hidden, folder)
    run = laboratory.run(asyncio.run(laboratory.choose(FIXED, 1)))
    report = discover(run)
    model = folder / "model.toml"
    report.save(model)
    return _judged(laboratory, model, world, report.effects, FIXED)


def _judged(
    laboratory: SimulatedLaboratory, model: Path, world: World, found: Sequence[str], poses: int,
    stopped: str = "",
) -> Came:  # fmt: skip
    false = len(set(found) - set(world.effects))
    return Came(
        3 * poses, laboratory.true_um(model), set(world.effects) <= set(found), false, stopped
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--worlds", type=int, default=100)
    parser.add_argument("--target-um", type=float, default=8.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    options = parser.parse_args()
    from bench import auto as here  # importable by name in the other processes

    jobs = [(world, options.target_um) for world in here.draw(options.worlds, options.seed)]
    with ProcessPoolExecutor(options.workers) as pool:
        pairs = list(pool.map(here.both, jobs))
    print("| | decides by itself | 40 poses at once |\n|---|---|---|")
    for says, of in (
        ("readings, median (10 %, 90 %)", lambda came: _spread([c.readings for c in came])),
        ("true error um, median (10 %, 90 %)", lambda came: _spread([c.true_um for c in came])),
        (
            f"true error within {options.target_um:g} um",
            lambda came: _share([c.true_um <= options.target_um for c in came]),
        ),
        ("all hidden effects named", lambda came: _share([c.named for c in came])),
        ("names that were not hidden, a world", lambda came: f"{_mean_false(came):.2f}"),
    ):
        print(f"| {says} | {of([a for a, _ in pairs])} | {of([b for _, b in pairs])} |")
    ends = [a.stopped for a, _ in pairs]
    print(f"\nOf {len(pairs)} worlds it said reached in {ends.count('True')}.")


def _spread(values: Sequence[float]) -> str:
    low, middle, high = np.quantile(values, [0.1, 0.5, 0.9])
    return f"{middle:.3g} ({low:.3g}, {high:.3g})"


def _share(true: Sequence[bool]) -> str:
    p = float(np.mean(true))
    return f"{100 * p:.0f} +- {100 * np.sqrt(max(p * (1 - p), 1e-12) / len(true)):.0f} %"


def _mean_false(came: Sequence[Came]) -> float:
    return float(np.mean([c.false_names for c in came]))


if __name__ == "__main__":
    main()
