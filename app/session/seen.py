"""What of the readings so far is needed to judge the next one."""

import math
from dataclasses import dataclass, field


@dataclass
class Seen:
    """Kept by the process, not by the journal: a session that goes on begins anew to look."""

    nest: str = ""
    """Nest read last, and where its SMR was predicted and read (tracker frame, mm)."""
    predicted: tuple[float, ...] = ()
    xyz: tuple[float, ...] = ()
    visit: tuple[float, str, tuple[float, ...]] = (-1.0, "", ())
    """Platform nest read last: when the machine had arrived, which nest, where it was seen."""
    answers: dict[str, list[float]] = field(default_factory=dict)
    """What each thermometer said, answer by answer."""
    asked_s: float = -math.inf
    told: set[str] = field(default_factory=set)
    """What was told already."""
