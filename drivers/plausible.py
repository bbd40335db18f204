"""Numbers that an instrument may send and that cannot be: no driver lets them through.

Protocols without a checksum (docs/reliability.md) deliver a wrong digit like a right one. What is
beyond what any instrument of its kind can read is refused here; what is merely unlikely is looked
at where more is known, against the commanded pose and against the other readings of a dwell.
"""

import math
from collections.abc import Iterable, Mapping

from drivers.errors import ProtocolError

FARTHEST_MM = 1e6
"""No laser tracker sees farther than a kilometre."""
SURVEYED_MM = 1e7
"""No total station measures farther than ten."""
SIGMA_MM = (1e-7, 1e3)
"""A standard uncertainty of a reading, at least and at most."""
WEATHER = {
    "temperature": (-60.0, 90.0),
    "pressure": (300.0, 1200.0),
    "humidity": (0.0, 110.0),
}
"""deg C, hPa, % of what sensors of air and structure can read."""
CHANNEL = 1e5
"""No channel of a controller reads more, in either direction: deg C, kg, and what else there is."""


def place(xyz: Iterable[float], device: str, farthest_mm: float = FARTHEST_MM) -> None:
    """Raise ProtocolError for coordinates (mm) that are none, or too far away."""
    between(xyz, -farthest_mm, farthest_mm, "place", device)


def uncertainty(sigma: tuple[float, float, float], mixed: tuple[float, ...], device: str) -> None:
    """Raise ProtocolError for standard uncertainties (mm) and covariances (mm^2) that are none."""
    between(sigma, *SIGMA_MM, "uncertainty", device)
    pairs = ((0, 1), (0, 2), (1, 2))
    for value, (a, b) in zip(mixed, pairs, strict=True):
        largest = 1.001 * sigma[a] * sigma[b]
        between((value,), -largest, largest, "covariance", device)


def weather(what: str, value: float, device: str) -> float:
    """The value (``temperature``, ``pressure``, ``humidity``), or ProtocolError if it is none."""
    between((value,), *WEATHER[what], what, device)
    return value


def channels(values: Mapping[str, float], device: str) -> None:
    """Raise ProtocolError for a channel's value that is none; a sensor that is not there is.

    A sensor's own sign that it is missing (nan, -127, 850, 6553.5) is another's to judge.
    """
    for name, value in values.items():
        if not math.isnan(value):
            between((value,), -CHANNEL, CHANNEL, name, device)


def between(values: Iterable[float], low: float, high: float, what: str, device: str) -> None:
    """Raise ProtocolError for a value outside of ``low`` to ``high``."""
    for value in values:
        if not low <= value <= high:
            raise ProtocolError(
                f"the {what} {value:g} cannot be",
                device=device,
                remedy=f"{low:g} to {high:g} can. Check cable and instrument, then measure again.",
            )
