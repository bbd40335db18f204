"""The tracking mechanism's part of a controller: tilt and azimuth become motor angles.

The controller holds all 83 errors and closes the whole mechanism with them, as a real controller
of such a machine would have to: the errors have no closed form.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from mocks.canopen.unreachable import Unreachable
from mocks.physics.ptm import LIMBS
from mocks.physics.ptm_body import PtmBody


class PtmKinematics:
    """Two motors that point the platform's z axis."""

    limbs = LIMBS

    def __init__(self) -> None:
        self._body = PtmBody()

    def reference(self, n: int, active: Mapping[str, float]) -> float:
        """Home is q = 0, whatever the controller holds."""
        return 0.0

    def targets(self, pose: Sequence[float], active: Mapping[str, float]) -> list[float]:
        """q (rad) at ``pose`` = tilt, azimuth (rad); raises Unreachable."""
        held = {name: active[name] for name in (p.name for p in self._body.machine.parameters)}
        try:
            q = self._body.commanded(held, np.array([pose], dtype=float))[0]
        except (ArithmeticError, np.linalg.LinAlgError) as error:
            raise Unreachable(0) from error
        for n, value in enumerate(q):
            if not math.isfinite(value):
                raise Unreachable(n)
        return [float(value) for value in q]
