"""Is the predicted uncertainty true? Truth drawn anew from the prior in each trial.

    python -m bench coverage [trials] [run] [tcp://HOST:PORT]

Prints, for every parameter, the standard deviation of (estimate - truth) / predicted sigma over
the trials; 0.9 .. 1.1 is wanted. With the address of a Dask scheduler its workers do it.
"""

import os
import sys
import time
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from app.files.runs import read_run
from app.spread import spread
from calib.identify import fit
from calib.identify.batch import fit_draws
from calib.model import Model
from calib.model.many import drawn_readings
from calib.model.state import State
from calib.runs.stack import stack

RUN = Path(__file__).parents[1] / "tests" / "data" / "runs" / "no-effect"
SHARE = 50
"""Trials of one question; each trial has a seed of its own, whoever does it."""
ONE_BY_ONE = 20
"""Trials that are also fitted one by one, to compare times and values."""

Question = tuple[Path, range]


def model_of(run: Path) -> tuple[Model, State]:
    loaded = read_run(run)
    model = Model(stack(loaded.machine, [loaded.run]))
    return model, fit(model).linear.state


def pulls(asked: Question) -> np.ndarray:
    """(estimate - truth) / predicted sigma, shape (trials, p)."""
    run, trials = asked
    model, state = model_of(run)
    truth, position = drawn_readings(model, state, [(1, trial) for trial in trials])
    found = fit_draws(model, position, state)
    count = model.free.size
    return ((found.values[:count] - truth[model.free]) / found.sigmas[:count]).T


def shared(trials: int, run: Path, workers: int, scheduler: str = "") -> np.ndarray:
    """Pulls of all trials, shared among processes or the workers of a scheduler."""
    from bench import coverage as here  # importable by name in the other processes

    asked = [(run, range(at, min(at + SHARE, trials))) for at in range(0, trials, SHARE)]
    found = dict(spread(here.pulls, asked, workers=workers, scheduler=scheduler))
    return np.concatenate([found[number] for number in range(len(asked))])


def beside_one_by_one(run: Path) -> str:
    """Times of one trial, together and alone, and how far the two are apart."""
    model, state = model_of(run)
    _, position = drawn_readings(model, state, [(1, trial) for trial in range(SHARE)])
    begin = time.process_time()
    found = fit_draws(model, position, state)
    together = (time.process_time() - begin) / SHARE
    begin = time.process_time()
    alone = [
        fit(Model(replace(model.rows, position=position[:, :, trial])))
        for trial in range(ONE_BY_ONE)
    ]
    one = (time.process_time() - begin) / ONE_BY_ONE
    off = max(
        float(np.max(np.abs(found.values[:, k] - own.values) / own.sigmas))
        for k, own in enumerate(alone)
    )
    return (
        f"one identification: together {1e3 * together:.2f} ms, alone {1e3 * one:.1f} ms "
        f"(ratio {one / together:.0f}); apart by {off:.1g} sigma at most"
    )


def main() -> None:
    words = [word for word in sys.argv[1:] if "://" not in word]
    scheduler = next((word for word in sys.argv[1:] if "://" in word), "")
    trials = int(words[0]) if words else 1000
    run = Path(words[1]) if len(words) > 1 else RUN
    begin = time.perf_counter()
    drawn = shared(trials, run, 2, scheduler)
    took = time.perf_counter() - begin
    spread_of = drawn.std(axis=0)
    model, _ = model_of(run)
    for name, value in zip(model.names, spread_of, strict=False):
        print(f"{name:12s} {value:.3f}")
    inside = np.mean(np.abs(drawn) < 1.0)
    print(f"{trials} identifications in {took:.1f} s on {scheduler or 'two processes'}")
    print(f"smallest {spread_of.min():.3f}, largest {spread_of.max():.3f}; wanted 0.9 .. 1.1")
    print(f"68 % intervals hold {100 * inside:.1f} %")
    print(beside_one_by_one(run))


if __name__ == "__main__":
    main()
