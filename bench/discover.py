"""Speed of a diagnosis, and its false alarms on the very problem of a run.

    python -m bench.discover [--poses 100] [--null 200]

Speed: a hexapod run of ``--poses`` poses and three nests, whole catalogue and all structure, after
loading and fitting (one core). False alarms: residuals drawn as they are if nothing is missing,
e ~ N(0, M) of that run's fit, each diagnosed with null draws of its own; nominal 5 %.
"""

import argparse
import os
import time

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from app.files.machines import load_machine
from calib.discover.diagnosis import diagnose_fit
from calib.discover.problem import effect_candidates, quadratics_of, variables_of
from calib.effects import catalogue
from calib.evidence import LinearProblem, diagnose, structure_candidates
from calib.evidence.draws import residuals_of
from calib.identify import Fit, fit
from calib.identify.signatures import effect_columns
from calib.model import Model
from calib.runs import parse_run
from calib.runs.stack import stack
from mocks.simulate import RunPlan, simulate
from mocks.simulate.files import points_csv, run_toml


def fitted(poses: int) -> Fit:
    """The fit of a simulated run in which nothing is hidden."""
    simulated = simulate(RunPlan(seed=1, poses=poses, noise_mm=0.005))
    run = parse_run(run_toml(simulated), points_csv(simulated), actuators=6)
    return fit(Model(stack(load_machine("hexapod"), [run])))


def false_alarms(found: Fit, count: int) -> float:
    """Part of ``count`` residuals without anything missing that are found inadequate."""
    problem = found.problem
    effects = effect_candidates(
        found, problem, effect_columns(found, catalogue(found.model.machine))
    )
    structure, quadratic = structure_candidates(variables_of(found)), quadratics_of(found)
    rng = np.random.default_rng(2)
    alarms = 0
    for _ in range(count):
        residual = residuals_of(problem, 1, rng).array()[:, 1]
        null = LinearProblem(residual, problem.jacobian, problem.prior_precision)
        alarms += not diagnose(null, effects, structure, quadratic, rng=rng).adequate
    return alarms / count


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--poses", type=int, default=100)
    parser.add_argument("--null", type=int, default=200)
    options = parser.parse_args()
    found = fitted(options.poses)
    effects = catalogue(found.model.machine)
    times = []
    for _ in range(5):
        begin = time.perf_counter()
        diagnose_fit(found, effects, np.random.default_rng(1))
        times.append(time.perf_counter() - begin)
    print(f"{found.readings} readings, {len(effects)} effects: diagnosis {min(times):.2f} s")
    if not options.null:
        return
    rate = false_alarms(found, options.null)
    spread = np.sqrt(0.05 * 0.95 / options.null)
    print(f"false alarms {rate:.1%} of {options.null} (5 % +- {spread:.1%} wanted)")


if __name__ == "__main__":
    main()
