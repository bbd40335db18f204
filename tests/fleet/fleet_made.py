"""Small fleets, and questions that other processes can be asked."""

import os
import signal
import time
from pathlib import Path
from typing import TYPE_CHECKING

import pkmcal

if TYPE_CHECKING:
    from app.jobs.fleet_machine import Asked, Found

POSES = 12


def make_fleet(folder: Path, count: int, **special: dict[str, float]) -> Path:
    """Runs m0, m1, ... of tripods; ``special`` names hidden effects of some."""
    for number in range(count):
        name = f"m{number}"
        pkmcal.simulate(
            "tripod", folder / name, seed=40 + number, poses=POSES, noise_um=5.0,
            effects=special.get(name),
        )  # fmt: skip
    return folder


def squared(number: int) -> int:
    return number * number


def squared_once_killed(asked: tuple[int, str]) -> int:
    """The first process that is asked of 3 dies of it."""
    number, mark = asked
    if number == 3 and not Path(mark).exists():
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return number * number


def always_killed(number: int) -> int:
    os.kill(os.getpid(), signal.SIGKILL)
    return number


def slowly(asked: "Asked") -> "Found":
    """Long enough that a worker can be killed meanwhile."""
    from app.jobs.fleet_machine import fit_machine

    time.sleep(0.3)
    return fit_machine(asked)
