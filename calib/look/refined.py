"""What the nominal machine showed of nests, put where fits want it."""

import numpy as np

from calib.look.seat_off import seat_refined
from calib.look.shape import placed
from calib.mechanism.description import Machine
from calib.runs.record import Run
from calib.runs.remark import Remark

TIMES = 2


def refined(machine: Machine, before: Run, run: Run, remark: Remark) -> Run:
    """The run that a hypothesis makes of ``before``, its nest or its table put right by fits."""
    if remark.name in {"smr-size", "nest-displaced"}:
        return seat_refined(machine, before, run)
    if remark.name == "nests-frame":
        for key, old, new in (
            ("platform", before.header.platform_nests, run.header.platform_nests),
            ("base", before.header.base_nests, run.header.base_nests),
        ):
            if any(not np.array_equal(old[name], new[name]) for name in old):
                for _ in range(TIMES):
                    run = placed(machine, run, key)
    return run
