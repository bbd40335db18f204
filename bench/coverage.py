"""Is the predicted uncertainty true? Truth drawn anew from the prior in each trial.

    python -m bench coverage [trials] [run]

Prints, for every parameter, the standard deviation of (estimate - truth) / predicted sigma over
the trials; 0.9 .. 1.1 is wanted.
"""

import os
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from app.files.runs import read_run
from calib.identify import fit
from calib.model import Model
from calib.model.synthetic import drawn_from_prior, synthetic_rows
from calib.runs.stack import stack

RUN = Path(__file__).parents[1] / "tests" / "data" / "runs" / "no-effect"


def pulls(trials: int, run: Path, seed: int) -> tuple[list[str], np.ndarray]:
    """(estimate - truth) / predicted sigma, shape (trials, p)."""
    loaded = read_run(run)
    model = Model(stack(loaded.machine, [loaded.run]))
    frames = fit(model).linear.state
    generator = np.random.default_rng(seed)
    answers = []
    for _ in range(trials):
        truth = drawn_from_prior(model, frames, generator)
        found = fit(Model(synthetic_rows(model, truth, generator)))
        off = found.values[: model.free.size] - truth.parameters[model.free]
        answers.append(off / found.sigmas[: model.free.size])
    return list(model.names[: model.free.size]), np.array(answers)


def shared(trials: int, run: Path, workers: int) -> tuple[list[str], np.ndarray]:
    """Pulls of all trials, shared among processes with seeds of their own."""
    from bench import coverage as here  # importable by name in the other processes

    share = -(-trials // workers)
    with ProcessPoolExecutor(workers) as pool:
        parts = list(
            pool.map(here.pulls, [share] * workers, [run] * workers, range(1, workers + 1))
        )
    return parts[0][0], np.concatenate([drawn for _, drawn in parts])[:trials]


def main() -> None:
    trials = int(sys.argv[1]) if len(sys.argv) > 1 else 1000
    run = Path(sys.argv[2]) if len(sys.argv) > 2 else RUN
    begin = time.perf_counter()
    names, drawn = shared(trials, run, workers=2)
    spread = drawn.std(axis=0)
    for name, value in zip(names, spread, strict=True):
        print(f"{name:12s} {value:.3f}")
    inside = np.mean(np.abs(drawn) < 1.0)
    print(f"{trials} identifications in {time.perf_counter() - begin:.1f} s on two processes")
    print(f"smallest {spread.min():.3f}, largest {spread.max():.3f}; wanted 0.9 .. 1.1")
    print(f"68 % intervals hold {100 * inside:.1f} %")


if __name__ == "__main__":
    main()
