"""The steps of the filter in C (calib/noise/core/filter.c); called by filtering.py.

Arrays are C-contiguous, float64 but for ``begun`` and ``reading`` (np.int64; -1 where a sequence
has ended).
``ValueError`` where sizes do not go together, ``TypeError`` for another kind of array.
"""

from calib.arrays import Array, IntArray

VERSION: int

def gains(
    steps: int,
    sequences: int,
    states: int,
    seen: Array,
    fade: Array,
    fresh: Array,
    noise: Array,
    gain: Array,
    white: Array,
    spread: Array,
) -> None: ...
def innovations(
    steps: int,
    sequences: int,
    states: int,
    readings: int,
    columns: int,
    reading: IntArray,
    seen: Array,
    fade: Array,
    gain: Array,
    white: Array,
    rows: Array,
    out: Array,
) -> None: ...
def products(
    steps: int,
    sequences: int,
    states: int,
    ties: int,
    readings: int,
    columns: int,
    whitened: int,
    variance: float,
    share: float,
    visit: float,
    reading: IntArray,
    begun: IntArray,
    seen: Array,
    rho: Array,
    own: Array,
    rows: Array,
    spread: Array,
    out: Array,
) -> None: ...
