"""One run of the bench ``look``: simulated, looked at, judged."""

import numpy as np

from bench._blind_cases import Case, build, drawn_on
from bench._record_mistakes import MISTAKES, clean_run, machine_named, read_back
from calib.errors import BadInput
from calib.look import first_look

MACHINES = ("hexapod", "tripod", "ptm")
ALIKE = {"nests-mirrored": "nests-exchanged"}
"""Mistakes that some nest tables cannot tell apart: the remark then says both."""
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
    return effect, tuple(remark.name for remark in rows.remarks)


def _where(seed: int) -> tuple[str, str]:
    """Machine and order of measuring."""
    return MACHINES[seed % 3], ORDERS[(seed // 6) % 2]


def mistaken(asked: tuple[str, int]) -> tuple[str, str]:
    """Whether a mistake is named: ``found``, ``missed``, or the other name that is given."""
    name, seed = asked
    machine, order = _where(seed)
    make, expected = MISTAKES[name]
    run = make(clean_run(machine, 50_000 + seed, order=order), np.random.default_rng(seed))
    try:
        said = [remark.name for remark in first_look(machine_named(machine), [run]).remarks]
    except BadInput as error:
        return name, f"refused: {error.what[:60]}"
    if said == [expected] or said == [ALIKE.get(expected)]:
        return name, "found"
    return name, ", ".join(said) or "missed"
