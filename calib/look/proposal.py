"""A hypothesis that changes the record: what it is worth, and how the run reads with it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from calib.arrays import Array
from calib.runs.record import Run
from calib.runs.remark import Remark


@dataclass(frozen=True)
class Proposal:
    """``explained`` readings stand where they should; ``take`` gives the run and what is said."""

    explained: int
    take: Callable[[], tuple[Run, Remark]]
    known: Mapping[str, Array] = field(default_factory=dict)
    """Effects that it puts into the model, with values near which they are found."""
