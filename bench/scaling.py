"""Studies by one process and by two: seconds of the wall and of the processors.

    python -m bench scaling [--machines 2000] [--page docs/fleet.md]

Monte Carlo of uncalibrated machines, of calibrations, and searches for poses, each the same
question of the hexapod asked in this process and of two of :mod:`app.spread`. Answers must be the
same. On a computer on which other programs run the wall says little: compare the processors'.
"""

import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import argparse
import resource
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from datetime import UTC, datetime
from multiprocessing import active_children
from pathlib import Path

import pkmcal
from bench._page_table import put

HEAD = "| study | one process | two processes | started | load |\n| --- | --- | --- | --- | --- |"


@dataclass(frozen=True)
class Taken:
    """Seconds of the wall and of the processors, children's included."""

    wall_s: float
    cpu_s: float

    def __str__(self) -> str:
        return f"{self.wall_s:.1f} s, {self.cpu_s:.1f} s of processor"


def used() -> float:
    """Seconds of processor of this process and of those that have ended."""
    both = (resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(one.ru_utime + one.ru_stime for one in both)


def taken(work: Callable[[], object]) -> tuple[Taken, object]:
    """How long something takes, and its answer."""
    wall, cpu = time.perf_counter(), used()
    answer = work()
    ended = time.perf_counter() - wall
    while active_children():  # which asks for those that have ended: their time counts
        time.sleep(0.02)
    return Taken(ended, used() - cpu), answer


def studies(machines: int) -> Iterator[tuple[str, Callable[[int], object]]]:
    """Each study, by a number of workers; what it answers is told as numbers."""
    yield (
        f"`sensitivity --monte-carlo {machines}`, 200 poses",
        lambda workers: (
            pkmcal.sensitivity("hexapod", poses=200, monte_carlo=machines, workers=workers).drawn
        ),
    )
    yield (
        f"`identifiability --monte-carlo {machines}`, 60 poses",
        lambda workers: (
            pkmcal.identifiability("hexapod", monte_carlo=machines, workers=workers).drawn
        ),
    )
    yield (
        "`poses --searches 16`, 500 candidates",
        lambda workers: [
            one.q
            for one in pkmcal.choose_poses(
                "hexapod", 29, candidates=500, searches=16, workers=workers
            ).poses
        ],
    )


def rows(machines: int) -> Iterator[str]:
    """Rows of the table, as they come."""
    for name, ask in studies(machines):
        started, load = datetime.now(UTC), os.getloadavg()[0]
        one, here = taken(lambda ask=ask: ask(1))
        two, there = taken(lambda ask=ask: ask(2))
        if here != there:
            raise SystemExit(f"{name}: two processes answer otherwise than one")
        yield f"| {name} | {one} | {two} | {started:%d %B %Y, %H:%M} | {load:.0f} |"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machines", type=int, default=2000)
    parser.add_argument("--page", type=Path)
    options = parser.parse_args()
    print(HEAD)
    found = []
    for row in rows(options.machines):
        found.append(row)
        print(row, flush=True)
    if options.page is not None:
        put(options.page, "scaling", "\n".join([HEAD, *found]))


if __name__ == "__main__":
    main()
