"""What fades as exp(-t / tau), for every tau that a step of a fit may ask for."""

from typing import Any

SHORTEST_S = 1e-3
"""A time constant below this, or below zero, leaves nothing by the first reading: no division."""


def time_constant(value: Any) -> float:
    """A time constant in s that may be divided by; a step that left the sensible is refused later.

    The damped fit compares the cost before and after a step: with nothing left of the effect it
    rises, and a shorter step is tried.
    """
    return max(float(value), SHORTEST_S)
