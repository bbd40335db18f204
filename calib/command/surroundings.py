"""What a command must know beside the pose: load, temperatures, time."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from calib.arrays import Array
from calib.errors import BadInput


@dataclass(frozen=True, eq=False)
class Surroundings:
    """State readings at which commands are computed, each one number or one for every pose (N,).

    Attributes
    ----------
    channels : mapping of str to float or (N,)
        By column name: ``payload_kg``, ``structure_temp_C``, ``delay_s`` and whatever an
        operator's own formula names. Without ``payload_kg`` there is no payload.
    time_s : float, (N,) or None
        When the machine will stand there, s from the start of its history; for effects that fade
        with time.
    """

    channels: Mapping[str, float | Array] = field(default_factory=dict)
    time_s: float | Array | None = None

    def channel(self, name: str, count: int) -> Array:
        """One channel for ``count`` poses, (N,).

        Raises
        ------
        BadInput
            If it has another number of values, or one that is not finite.
        """
        return _spread(self.channels[name], count, name)

    def times(self, count: int) -> Array:
        """Times (N,) in s; zero where none is told."""
        return _spread(0.0 if self.time_s is None else self.time_s, count, "time_s")


def _spread(value: float | Array, count: int, name: str) -> Array:
    if isinstance(value, float | int) and math.isfinite(value):
        return np.full(count, float(value))
    values = np.asarray(value, dtype=np.float64)
    if values.ndim and values.shape != (count,):
        raise BadInput(
            f"{name} has the shape {values.shape}, and there are {count} poses",
            remedy="Give one number, or one for each pose",
        )
    if not np.isfinite(values).all():
        raise BadInput(f"{name} is not a finite number", remedy="Give a number")
    return np.broadcast_to(values, (count,)).astype(np.float64)
