"""The compiled kinematics, C over flat tables (calib/mechanism/core); called by kernel.py.

Arrays are C-contiguous, float64 but for ``ints`` and ``places`` (np.intc), component first and
pose last. ``parameters`` is (P,) or (P, N). A place is position (3, n), rotation (9, n), passive
(J, n), extension (a, n) and strain (c, n), with n = N or 1. Outputs are written in place.
``ValueError`` where sizes do not go together, ``TypeError`` for another kind of array.
"""

from typing import NewType

from calib.arrays import Array, CIntArray

Tables = NewType("Tables", object)

VERSION: int

def prepare(ints: CIntArray, reals: Array) -> Tables: ...
def processor() -> str: ...
def choose(name: str) -> None: ...
def solve(
    machine: Tables,
    count: int,
    parameters: Array,
    extension: Array | None,
    target: Array | None,
    goal: Array | None,
    series: Array | None,
    out: Array,
    *start: Array | None,
) -> None: ...
def differentiate(
    machine: Tables,
    count: int,
    parameters: Array,
    position: Array,
    rotation: Array,
    passive: Array,
    extension: Array,
    strain: Array,
    by_parameter: Array,
    by_actuator: Array,
) -> None: ...
def lock(
    machine: Tables,
    count: int,
    parameters: Array,
    position: Array,
    rotation: Array,
    passive: Array,
    extension: Array,
    strain: Array,
    places: CIntArray,
    out: Array,
) -> None: ...
def rows(
    machine: Tables,
    count: int,
    parameters: Array,
    position: Array,
    rotation: Array,
    passive: Array,
    extension: Array,
    strain: Array,
    out: Array,
) -> None: ...
