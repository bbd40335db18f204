"""Blind trial: hidden effects in simulated runs, found without seeing the truth, and scored.

    python -m bench blind [--cases 400] [--null 400] [--seed 1] [--page docs/blind-trial.md]

The runs come from the mock's own physics (`mocks.simulate`), which imports neither the engine nor
the effects. What is written to the page is measured by this command.
"""

import argparse
import os
import time
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from functools import lru_cache
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from app.files.machines import load_machine
from bench._blind_cases import SIGMA_MM, Case, build, displaced, draw_cases
from bench._blind_page import page
from calib.discover.pairs import power
from calib.discover.run_discovery import Refitter, RunStage, discover_run, stage_of
from calib.effects import catalogue
from calib.errors import BadInput
from calib.poses.design import design_poses
from calib.poses.readings import NestReadings
from calib.runs import parse_header, parse_run
from calib.runs.stack import Rows, stack
from mocks.simulate.files import points_csv, run_toml

POSE_SETS = ("designed 29", "random 29", "random 60", "random 100")


@dataclass(frozen=True)
class Outcome:
    """What was found in one case, beside the truth."""

    case: Case
    adequate: bool
    first: str | None
    found: tuple[str, ...]
    groups: tuple[tuple[str, ...], ...]
    unexplained: bool
    holdout_over_floor: float
    holdout_rose: bool
    pulls: tuple[float, ...] = ()
    predicted_power: float = float("nan")
    detected: bool = False
    likeness: float = float("nan")
    bad: int = 0
    seconds: float = 0.0
    hidden: dict[str, float] = field(default_factory=dict)
    failure: str = ""


@lru_cache(maxsize=8)
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
    chosen = design_poses(load_machine(machine), readings, 29, generator, counts=())
    return np.asarray(chosen.pose_set.task.T)


def poses_of(case: Case) -> object:
    """Poses of a case: a designed set, or a number of random ones."""
    kind, number = case.poses.split()
    return designed(case.machine, case.seed % 3) if kind == "designed" else int(number)


def solve(case: Case) -> Outcome:
    """Simulate, discover, compare."""
    poses = poses_of(case)
    simulated, hidden = build(case, poses)
    machine = load_machine(case.machine)
    actuators = len(machine.actuators)
    run = parse_run(run_toml(simulated), points_csv(simulated), actuators=actuators)
    rows = stack(machine, [run])
    begin = time.perf_counter()
    refit = Refitter(rows, catalogue(machine))
    found = discover_run(refit)
    seconds = time.perf_counter() - begin
    first, last = stage_of(found, 0), stage_of(found)
    held = [stage_of(found, k).holdout for k in range(len(found.steps))]
    predicted, detected, likeness = _foreseen(case, poses, hidden, first)
    return Outcome(
        case=case,
        adequate=first.diagnosis.adequate,
        first=found.steps[1].added if len(found.steps) > 1 else None,
        found=last.effects,
        groups=tuple(found.indistinguishable),
        unexplained=last.diagnosis.unexplained.significant,
        holdout_over_floor=last.run.holdout.rms_mm / last.run.holdout.floor_mm,
        holdout_rose=bool(np.any(np.diff(held) > 1e-9)),
        pulls=_pulls(rows, hidden, last),
        predicted_power=predicted,
        detected=detected,
        likeness=likeness,
        bad=len(last.run.fit.bad),
        seconds=seconds,
        hidden=hidden,
    )


def _pulls(rows: Rows, hidden: dict[str, float], last: RunStage) -> tuple[float, ...]:
    """(estimate - truth) / sigma of the hidden effects' unknowns where the right ones are found."""
    truly = {name.split(".")[0] for name in hidden}
    if set(last.effects) != truly:
        return ()
    fit = last.run.fit
    values = dict(zip(fit.model.names, zip(fit.values, fit.sigmas, strict=True), strict=True))
    unknowns = [u for group in fit.model.unknowns for u in group if not u.nonlinear]
    return tuple(
        (values[u.name][0] - hidden.get(u.name, 0.0)) / values[u.name][1]
        for u in unknowns
        if u.sigma is None and not u.name.startswith("frame-shift")
    )


def _foreseen(
    case: Case, poses: object, hidden: dict[str, float], first: RunStage
) -> tuple[float, bool, float]:
    """Predicted power and detection of a single effect; likeness of an unknown one to the known."""
    if len(case.effects) != 1:
        return float("nan"), False, float("nan")
    fit, diagnosis = first.run.fit, first.diagnosis
    moved = displaced(case, poses, hidden)
    whitened = np.einsum("ijn,jn->in", fit.model.rows.whitener, moved)
    signature = whitened[:, fit.accepted].reshape(-1)
    scores = diagnosis.scores
    left = scores.problem.project(signature)
    norm = float(signature @ left)
    likeness, predicted = 0.0, []
    for index, candidate in enumerate(scores.candidates):
        if case.unknown and candidate.channel:
            predicted.append(power(scores, diagnosis.family, index, signature))
        if candidate.channel:
            continue
        if not case.unknown and candidate.name == case.effects[0]:
            predicted.append(power(scores, diagnosis.family, index, signature))
        overlap = candidate.columns @ left
        for trial, weighing in enumerate(scores.weighings[index][0].whiten):
            unit = overlap[trial] / np.maximum(scores.norms[index][trial], 1e-300)
            likeness = max(likeness, float(np.sum((weighing @ unit) ** 2)) / norm)
    findings = {finding.name: finding for finding in diagnosis.findings}
    known = findings.get(case.effects[0])
    detected = known is not None and known.p_value <= 0.05
    return max(predicted, default=float("nan")), detected, float(np.sqrt(likeness))


def attempt(case: Case) -> Outcome:
    """Solve a case; one that ends in an error counts as wrong and is listed on the page."""
    try:
        return solve(case)
    except (BadInput, ValueError, ArithmeticError) as error:
        return Outcome(case, True, None, (), (), False, float("nan"), False, failure=str(error))


def run_all(cases: Sequence[Case], workers: int) -> list[Outcome]:
    """Solve all cases on several processes."""
    from bench import blind as here  # importable by name in the other processes

    with ProcessPoolExecutor(workers) as pool:
        return list(pool.map(here.attempt, cases, chunksize=4))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=400)
    parser.add_argument("--null", type=int, default=400)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--machines", default="hexapod,tripod")
    parser.add_argument("--only", choices=("single", "several", "unknown"))
    parser.add_argument("--page", type=Path)
    options = parser.parse_args()
    command = f"python -m bench blind --cases {options.cases} --null {options.null}"
    text = f"# Blind trial\n\nWritten by `{command} --seed {options.seed}`.\n"
    for machine in options.machines.split(","):
        begin = time.perf_counter()
        cases = [
            case
            for case in draw_cases(options.cases, options.seed, POSE_SETS, machine)
            if options.only is None or options.only == case.kind
        ]
        nulls = [
            Case(500_000 + 1000 * options.seed + k, (), (), POSE_SETS[k % 4], machine=machine)
            for k in range(options.null)
        ]
        outcomes = run_all([*cases, *nulls], options.workers)
        text += "\n" + page(outcomes, machine, time.perf_counter() - begin)
    print(text)
    if options.page is not None:
        options.page.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
