"""A mistake: what is done to a clean run, and what is to be said of it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from calib.runs.record import Run

Chance = np.random.Generator
Make = Callable[[Run, Chance], Run]
THREE = ("hexapod", "tripod", "ptm")


@dataclass(frozen=True)
class Mistake:
    """What is done to a run, and which remarks say so (any of them); or how it is refused."""

    make: Make
    says: tuple[str, ...] = ()
    refused: str = ""
    only: tuple[str, ...] = THREE
    hidden: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    """Physics that is in the run besides, by machine."""
