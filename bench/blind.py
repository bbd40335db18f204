"""Blind trial: hidden effects in simulated runs, found without seeing the truth, and scored.

    python -m bench blind [--cases 400] [--null 400] [--seed 1] [--page docs/blind-trial.md]
    python -m bench blind --cases 60 --null 100 --noise ar:0.5    # walk:0.3, visit:1, t:5 ...
    python -m bench blind --keep FOLDER --minutes 30              # again and again: it goes on

The runs come from the mock's own physics (`mocks.simulate`), which imports neither the engine nor
the effects. What is written to the page is measured by this command.
"""

import argparse
import hashlib
import os
import pickle
import time
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from app.files.machines import load_machine
from app.jobs.posing import choose_poses
from app.spread import spread
from bench._blind_cases import SIGMA_MM, Case, build, draw_cases, draw_nulls
from bench._blind_follow_up import follow_up, named
from bench._blind_judge import Foreseen, foreseen, pulls
from bench._blind_page import INTRODUCTION, page
from calib.discover.discovery import Refitter, discover_run, stage_of
from calib.effects import catalogue
from calib.errors import BadInput
from calib.evidence.forward import Discovery, hints, speaks_against
from calib.mechanism.description import Machine
from calib.poses.design import design_poses
from calib.poses.readings import NestReadings
from calib.runs import parse_header, parse_run
from calib.runs.stack import stack
from mocks.simulate.files import points_csv, run_toml

SHARE = 4
"""Cases of one question."""
OF_OLD = (
    "backlash", "creep", "frame-shift", "gravity-sag", "joint-azimuth", "joint-tilt",
    "leg-compliance", "nest-offset", "parallelogram-sides", "redundancy", "screw-cyclic",
    "screw-pitch", "screw-twist", "settling", "thermal-growth", "tracker-drift", "tracker-offset",
    "tracker-scale",
)  # fmt: skip
"""A catalogue of earlier: what those that came since cost its effects is told."""


@dataclass(frozen=True)
class Outcome:
    """What was found in one case, beside the truth.

    ``first`` is the effect that the first diagnosis names, ``found`` those that discovery has added
    and kept; ``foreseen`` one for each hidden effect, in a model that has the others; ``after`` the
    first effect and the groups after a designed follow-up, where there was one; ``hinted`` what was
    called for too weakly to be added. ``among_fewer`` is the power where only the effects of an
    earlier catalogue are looked for, of one hidden effect; ``seconds`` are CPU time of discovery.
    """

    case: Case
    adequate: bool
    first: str | None
    found: tuple[str, ...]
    groups: tuple[tuple[str, ...], ...]
    unexplained: bool
    holdout_over_floor: float
    holdout_rose: bool
    pulls: tuple[float, ...] = ()
    foreseen: tuple[Foreseen, ...] = ()
    among_fewer: float = float("nan")
    after: tuple[str | None, tuple[tuple[str, ...], ...]] | None = None
    hinted: tuple[str, ...] = ()
    bad: int = 0
    seconds: float = 0.0
    hidden: dict[str, float] = field(default_factory=dict)
    failure: str = ""


@lru_cache(maxsize=3)
def machine_named(name: str) -> Machine:
    """A shipped machine, loaded once."""
    return load_machine(name)


@lru_cache(maxsize=9)
def designed(machine: str, number: int) -> np.ndarray:
    """29 poses chosen for predicted pose error, (29, k) in the machine's task coordinates."""
    empty, _ = build(Case(0, (), (), "", machine=machine), 4)
    header = parse_header(run_toml(empty))
    readings = NestReadings(
        np.array(list(header.platform_nests.values())).T,
        SIGMA_MM,
        np.array(list(header.base_nests.values())).T,
    )
    generator = np.random.default_rng(number)
    chosen = design_poses(machine_named(machine), readings, 29, generator, counts=())
    return np.asarray(chosen.pose_set.task.T)


@lru_cache(maxsize=9)
def for_discovery(machine: str, number: int) -> np.ndarray:
    """29 poses of which a third is chosen to show effects, (29, k) in task coordinates."""
    chosen = choose_poses(machine, n=29, purpose="discovery", seed=1 + number)
    names = machine_named(machine).task.coordinates
    return np.array([[pose.coordinates[name] for name in names] for pose in chosen.poses])


def poses_of(case: Case) -> object:
    """Poses of a case: a designed set, or a number of random ones."""
    kind, number = case.poses.split()
    if kind == "discovery":
        return for_discovery(case.machine, case.seed % 3)
    return designed(case.machine, case.seed % 3) if kind == "designed" else int(number)


def solve(case: Case) -> Outcome:
    """Simulate, discover, compare."""
    poses = poses_of(case)
    simulated, hidden = build(case, poses)
    begin = time.process_time()
    machine = machine_named(case.machine)
    run = parse_run(run_toml(simulated), points_csv(simulated), actuators=len(machine.actuators))
    rows = stack(machine, [run])
    refit = Refitter(rows, catalogue(machine))
    found = discover_run(refit)
    seconds = time.process_time() - begin
    last = stage_of(found)
    name, groups = named(found)
    after = None
    usual = case.kind == "single" and case.sizes == (1.0,) and not case.noise
    if usual and case.poses.startswith("designed"):
        after = follow_up(found, simulated, hidden)
    return Outcome(
        case=case,
        adequate=stage_of(found, 0).diagnosis.adequate,
        first=name,
        found=last.effects,
        hinted=hints(last.diagnosis, last.effects),
        groups=groups,
        unexplained=last.diagnosis.unexplained.significant,
        holdout_over_floor=last.run.holdout.rms_mm / last.run.holdout.floor_mm,
        holdout_rose=_rose(found),
        pulls=pulls(rows, hidden, last),
        foreseen=_foreseen(case, poses, hidden, refit),
        among_fewer=_among_fewer(case, poses, hidden, refit),
        after=after,
        bad=len(last.run.fit.bad),
        seconds=seconds,
        hidden=hidden,
    )


def _rose(found: Discovery) -> bool:
    """Whether held-out poses are predicted worse in the end than before the last effect added."""
    held = [step.stage.holdout for step in found.steps]
    added = [k for k, step in enumerate(found.steps) if step.added is not None]
    risen = any(speaks_against(held[k - 1], held[k]) for k in added)
    return risen or bool(added and speaks_against(held[added[-1] - 1], held[-1]))


def _foreseen(
    case: Case, poses: object, hidden: dict[str, float], refit: Refitter
) -> tuple[Foreseen, ...]:
    """Every effect of a single or a pair, in the model that has the other."""
    if len(case.effects) > 2 or case.noise:
        return ()
    found = []
    for effect in case.effects:
        others = tuple(other for other in case.effects if other != effect)
        found.append(foreseen(case, poses, hidden, effect, refit(others)))
    return tuple(found)


def _among_fewer(case: Case, poses: object, hidden: dict[str, float], refit: Refitter) -> float:
    """Power of one hidden effect where only those of an earlier catalogue are looked for."""
    if case.kind != "single" or case.noise or case.effects[0] not in OF_OLD:
        return float("nan")
    fewer = [effect for effect in refit.effects.values() if effect.id in OF_OLD]
    stage = Refitter(refit.rows, fewer)(())
    return foreseen(case, poses, hidden, case.effects[0], stage).power


def attempt(case: Case) -> Outcome:
    """Solve a case; one that ends in an error counts as wrong, or as an alarm, and is listed."""
    try:
        return solve(case)
    except (BadInput, ValueError, ArithmeticError) as error:
        return Outcome(case, False, None, (), (), False, float("nan"), False, failure=str(error))


@dataclass(frozen=True)
class Share:
    """Some cases, and the file that keeps what was found in them; none where nothing is kept."""

    cases: tuple[Case, ...]
    file: Path | None = None
    until: float = float("inf")
    """Not begun after this time of ``time.time``."""

    def found(self) -> list[Outcome]:
        """What is kept; solved and kept where it is not; nothing where it is too late."""
        if self.file is not None and self.file.exists():
            return list(pickle.loads(self.file.read_bytes()))
        if time.time() > self.until:
            return []
        outcomes = [attempt(case) for case in self.cases]
        if self.file is not None:
            part = self.file.with_suffix(f".{os.getpid()}")
            part.write_bytes(pickle.dumps(outcomes))
            part.replace(self.file)
        return outcomes


def run_all(
    cases: Sequence[Case],
    workers: int,
    scheduler: str = "",
    keep: Path | None = None,
    minutes: float = float("inf"),
) -> list[Outcome]:
    """Solve all cases on several processes, or by the workers of a Dask scheduler.

    With a folder ``keep`` what was solved is kept there and not asked again, and no share is begun
    after so many minutes; shares are asked in an order that is drawn, so that some stand for all.
    """
    from bench import blind as here  # importable by name in the other processes

    until = time.time() + 60.0 * minutes
    shares = []
    for first in range(0, len(cases), SHARE):
        some = tuple(cases[first : first + SHARE])
        name = hashlib.sha256(repr(some).encode()).hexdigest()[:16] + ".outcomes"
        shares.append(here.Share(some, None if keep is None else keep / name, until))
    order = np.random.default_rng(len(shares)).permutation(len(shares))
    asked = [shares[k] for k in order]
    found = dict(spread(here.Share.found, asked, workers=workers, scheduler=scheduler))
    answers = {int(order[number]): outcomes for number, outcomes in found.items()}
    return [one for number in range(len(shares)) for one in answers[number]]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=400)
    parser.add_argument("--null", type=int, default=400)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--scheduler", default="", help="address of a Dask scheduler instead")
    parser.add_argument("--machines", default="hexapod,tripod,ptm")
    parser.add_argument("--only", choices=("single", "several", "unknown"))
    parser.add_argument("--hide", help="effects that may be hidden, by comma; all by default")
    parser.add_argument("--noise", default="", help="other noise than is stated: ar:0.5 ...")
    parser.add_argument("--keep", type=Path, help="folder of what was solved; goes on from it")
    parser.add_argument(
        "--minutes", type=float, default=float("inf"), help="with --keep: then stop"
    )
    parser.add_argument("--page", type=Path)
    options = parser.parse_args()
    command = f"python -m bench blind --cases {options.cases} --null {options.null}"
    command += f" --machines {options.machines}"
    command += f" --hide {options.hide}" if options.hide else ""
    command += f" --noise {options.noise}" if options.noise else ""
    allowed = options.hide.split(",") if options.hide else None
    if options.keep is not None:
        options.keep.mkdir(parents=True, exist_ok=True)
    text = f"# Blind trial\n\nWritten by `{command} --seed {options.seed}`.\n{INTRODUCTION}"
    for machine in options.machines.split(","):
        cases = [
            case
            for case in draw_cases(options.cases, options.seed, machine, allowed)
            if options.only is None or options.only == case.kind
        ]
        nulls = draw_nulls(options.null, options.seed, machine)
        asked = [replace(case, noise=options.noise) for case in (*cases, *nulls)]
        outcomes = run_all(asked, options.workers, options.scheduler, options.keep, options.minutes)
        text += "\n" + page(outcomes, machine)
    print(text)
    if options.page is not None:
        options.page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
