"""One run of the bench ``look``: simulated, looked at, judged."""

import zlib

import numpy as np

from bench._blind_cases import Case, build, drawn_on
from bench.mistakes import MISTAKES, said_of
from bench.mistakes.clean import clean_run, machine_named, read_back
from calib.errors import BadInput
from calib.look import first_look

MACHINES = ("hexapod", "tripod", "ptm")
ORDERS = ("nest-by-nest", "pose-by-pose")


def clean(seed: int) -> tuple[str, tuple[str, ...]]:
    """What is hidden in a run without a mistake, and what the first look says of it."""
    generator = np.random.default_rng([seed, 11])
    machine, order = _where(seed)
    poses = int(generator.choice([29, 40, 60]))
    effect = "nothing hidden"
    if seed % 2:
        names = [name for name in drawn_on(machine, unknown=False) if name != "frame-shift"]
        effect = str(generator.choice(names))
        size = float(generator.choice([1.0, 3.0, 6.0]))
        made, _ = build(Case(seed, (effect,), (size,), "", machine=machine), poses)
        run = read_back(made, machine)
    else:
        run = clean_run(machine, seed, poses=poses, order=order)
    try:
        rows = first_look(machine_named(machine), [run])
    except BadInput as error:
        return effect, (str(error),)
    right = {"actuator-step": "actuator-slipped", "nest-step": "nest-moved"}.get(effect)
    return effect, tuple(remark.name for remark in rows.remarks if remark.name != right)


def _where(seed: int) -> tuple[str, str]:
    """Machine and order of measuring."""
    return MACHINES[seed % 3], ORDERS[(seed // 6) % 2]


def mistaken(asked: tuple[str, str, str, int]) -> tuple[str, str, str]:
    """What is said of a mistake on a machine, in an order: its name, the outcome, the words."""
    name, machine, order, seed = asked
    mistake = MISTAKES[name]
    hidden = mistake.hidden.get(machine)
    clean = clean_run(machine, 50_000 + seed, poses=32, order=order, hidden=hidden)
    run = mistake.make(clean, np.random.default_rng([seed, zlib.crc32(name.encode())]))
    return name, *said_of(mistake, machine_named(machine), run)
