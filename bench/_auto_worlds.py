"""Worlds in which the autopilot is tried: what is hidden in them, and what was made of them."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from bench._blind_cases import Case, build, drawn_on

MACHINE, FIXED, SIZE = "hexapod", 40, 2.0
HOURS = 6.0
QUIET_MM = 5e-5
"""Noise of the readings that tell a model's true error."""
CORRELATED, SLOW = "ar:0.3", "slow"
OF_ONE_RUN = ("frame-shift", "actuator-step", "nest-step", "warm-up")
"""Events of one run: a world of several runs cannot hold them alike."""
FROM_COLD = ("leg-warm-up",)
"""What happens while a machine warms up: in the first run, and not in those that follow."""
OF_THE_TRACKER = ("tracker-drift",)
"""What moves the tracker meanwhile, and is no error of the machine."""


def without(hidden: Mapping[str, float], over: tuple[str, ...]) -> dict[str, float]:
    """A hidden table without some effects."""
    return {name: value for name, value in hidden.items() if name.partition(".")[0] not in over}


@dataclass(frozen=True)
class World:
    """A machine with its hidden effects, how its readings err, and the seed of everything."""

    seed: int
    effects: tuple[str, ...]
    noise: str


@dataclass(frozen=True)
class Came:
    """What one way of measuring came to in one world.

    ``readings`` for the fit, ``proof`` those of verifications; ``open``: pairs that are in
    question at the end; ``reached``: what the autopilot said. On the wire: the machine's own true
    error, machine minutes, and seconds by the clock.
    """

    readings: int
    proof: int
    true_um: float
    named: bool
    false_names: int
    open: int
    reached: bool | None = None
    machine_um: float | None = None
    minutes: float | None = None
    wall_s: float | None = None


def draw(count: int, seed: int) -> list[World]:
    """Worlds with 0 to 3 hidden effects in turn, four with white and four with other noise."""
    rng = np.random.default_rng(seed)
    names = [name for name in drawn_on(MACHINE, unknown=False) if name not in OF_ONE_RUN]
    return [
        World(
            seed * 10_000 + k,
            tuple(map(str, rng.choice(names, k % 4, replace=False))),
            CORRELATED if k // 4 % 2 else "",
        )
        for k in range(count)
    ]


def draw_for_wires(count: int, seed: int) -> list[World]:
    """Worlds with 1, 2, 3 and 0 hidden effects in turn, all with noise that is slow."""
    rng = np.random.default_rng([seed, 2])
    names = [name for name in drawn_on(MACHINE, unknown=False) if name not in OF_ONE_RUN]
    return [
        World(
            seed * 10_000 + 5_000 + k,
            tuple(map(str, rng.choice(names, (k + 1) % 4, replace=False))),
            SLOW,
        )
        for k in range(count)
    ]


def hidden_in(world: World) -> Mapping[str, float]:
    """Hidden numbers of a world, each effect as large as all are."""
    case = Case(world.seed, world.effects, (SIZE,) * len(world.effects), "", machine=MACHINE)
    return build(case, 40)[1]
