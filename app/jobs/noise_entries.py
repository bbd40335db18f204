"""Noise in the answers of fits, diagnosis and discovery."""

from dataclasses import dataclass

from app.jobs.record import Record


@dataclass(frozen=True, kw_only=True)
class NoiseComponentEntry(Record):
    """A component of the noise, by its ``name``; ``of_what``, if not of all readings.

    ``correlated``: its time constant, s; ``walk``: its step from reading to reading, in sigmas;
    ``visit``: standard deviation of every actuator from visit to visit of a pose, mm or rad;
    ``scale``: that of the readings over what they state, ``scale-of`` of those of a nest,
    instrument, run or kind, or along or across the beam; ``added``: white noise beside what is
    stated, um or arcsec; ``range``: the same that grows with range, um/m. ``clear``: no chance (p
    below 1e-3); others only count in judging effects.
    """

    name: str
    of_what: str
    value: float
    sigma: float | None
    unit: str
    p_value: float
    clear: bool


@dataclass(frozen=True, kw_only=True)
class NoiseEntry(Record):
    """The noise that the readings demand; none of them: independent, as stated.

    ``uncertainty_ratio``: uncertainties with it over those without, the median; ``instead``:
    effects that would explain as much.
    """

    components: tuple[NoiseComponentEntry, ...]
    uncertainty_ratio: float
    instead: tuple[str, ...] = ()
    words: str
