"""Unknowns of effects and of candidates, and what is found for them."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, BoolArray

VAGUE = 1e3
"""Sizes in the standard deviation of an unknown without a prior of its own."""


@dataclass(frozen=True)
class Unknown:
    """A named number that a fit finds.

    Attributes
    ----------
    name, unit : str
    size : float
        How large it may reasonably be, in ``unit``: hypotheses are weighed with it. nan where
        only the readings can tell.
    sigma : float or None
        Standard deviation of its prior; None where the data alone should speak.
    nonlinear : bool
        Whether it is searched for, at trial values, before a fit can move it.
    bounds, steps
        Range and number of the trial values, where these are declared beforehand.
    means : callable, optional
        What a value of it means, in words, where the number alone says little: one of a few
        things that it numbers, or a moment on the clock of several runs.
    """

    name: str
    unit: str = ""
    size: float = math.nan
    sigma: float | None = None
    nonlinear: bool = False
    bounds: tuple[float, float] | None = None
    steps: int = 0
    means: "Choice | Moment | None" = None

    def in_words(self, value: float) -> dict[str, str]:
        """Entry ``means`` of a value, where there is more to say than the number."""
        told = self.means(value) if self.means is not None else ""
        return {"means": told} if told else {}

    @property
    def prior_sigma(self) -> float:
        """Standard deviation of its prior; without one, a thousand times its size.

        That is enough to keep collinear effects solvable, and too weak to bias anything.
        """
        return self.sigma or VAGUE * self.size


@dataclass(frozen=True)
class Choice:
    """A number that stands for one of a few things: pairs of number and name."""

    names: tuple[tuple[float, str], ...]

    def __call__(self, value: float) -> str:
        """Name of the nearest number."""
        return min(self.names, key=lambda one: abs(one[0] - value))[1]


@dataclass(frozen=True)
class Moment:
    """A moment on one clock over several runs, which begin at ``starts`` (s)."""

    starts: tuple[float, ...]

    def __call__(self, value: float) -> str:
        """``run 2 at 120 s``, ``the start of run 2``; nothing where there is but one run."""
        if len(self.starts) < 2:
            return ""
        run = max(k for k, start in enumerate(self.starts) if k == 0 or start <= value + 1e-6)
        since = value - self.starts[run]
        return f"run {run + 1} at {since:.0f} s" if since > 0.5 else f"the start of run {run + 1}"


@dataclass(frozen=True)
class Estimate:
    """What was found for an unknown: value and standard uncertainty, in its unit.

    ``identified`` is false where the readings leave it open.
    """

    unknown: Unknown
    value: float
    sigma: float
    identified: bool = True

    @property
    def name(self) -> str:
        """Name of the unknown."""
        return self.unknown.name

    @property
    def unit(self) -> str:
        """Unit of value and sigma."""
        return self.unknown.unit


def linear_among(unknowns: Iterable[Unknown]) -> BoolArray:
    """Which unknowns (U,) move the readings linearly."""
    return np.array([not unknown.nonlinear for unknown in unknowns], dtype=bool)


def estimates_of(unknowns: Sequence[Unknown], values: Array, sigmas: Array) -> tuple[Estimate, ...]:
    """Values (U,) and standard uncertainties (U,) beside their unknowns."""
    return tuple(
        Estimate(unknown, float(value), float(sigma))
        for unknown, value, sigma in zip(unknowns, values, sigmas, strict=True)
    )


def searched_in_words(unknowns: Iterable[Unknown], trial: Iterable[float]) -> str:
    """Where the nonlinear unknowns stand, ``period = 2.68 rad, side = 1``; empty without any."""
    searched = (unknown for unknown in unknowns if unknown.nonlinear)
    return ", ".join(
        f"{unknown.name.rpartition('.')[2]} = {value:.3g} {unknown.unit.replace('1', '')}".rstrip()
        for unknown, value in zip(searched, trial, strict=False)
    )
