"""Words for what a machine did over months."""

from typing import Protocol

from app.report.words import with_uncertainty


class Drifts(Protocol):
    """A line through a series: rate and sigma a month, months until it leaves what is allowed."""

    @property
    def rate(self) -> float:
        """A month."""

    @property
    def sigma(self) -> float:
        """Of the rate."""

    @property
    def months(self) -> float | None:
        """None if never, or nothing is known of that."""


def drift_words(found: Drifts, unit: str) -> str:
    """``2.1 +- 0.4 um a month; out of tolerance in about 5 months``."""
    scale, unit = (1e3, "um") if unit == "mm" else (1.0, unit)
    rate, sigma = with_uncertainty(scale * found.rate, scale * found.sigma)
    said = f"{rate} +- {sigma} {unit} a month"
    if found.months is None:
        return said
    if found.months < 1.0:
        return f"{said}; out of tolerance within a month"
    return f"{said}; out of tolerance in about {found.months:.0f} months"
