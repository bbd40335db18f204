"""What the noise is: as data, and in words."""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from calib.digits import plus_minus
from calib.identify.fitting import Fit
from calib.noise import Component
from calib.noise.scatter import ACROSS, ADDED, ADDED_ANGLE, ALONG, RANGE

CLEAR = 1e-3
"""p-value up to which a component is spoken of; a weaker one only counts in judging effects."""


def noise_report(fit: Fit, tied: Sequence[str] = ()) -> dict[str, Any]:
    """Entry ``noise`` of a fit, of its diagnosis or of a discovery; effects that say as much."""
    return {
        "components": [_entry(fit, one) for one in fit.components_of_noise],
        "uncertainty_ratio": fit.inflation,
        "instead": list(tied),
        "words": noise_words(fit, tied),
    }


def noise_words(fit: Fit, tied: Sequence[str] = ()) -> str:
    """What is clear of the noise, without a full stop; empty if the readings are as they say.

    ``tied`` effects explain as much.
    """
    told = [_says(fit, one) for one in fit.components_of_noise if one.p_value < CLEAR]
    if not told:
        return ""
    ratio = f"{fit.inflation:.2g} times those"
    of = "those" if ratio.startswith("1 ") else ratio
    instead = f". Or it is {' or '.join(tied)}: these readings do not tell" if tied else ""
    return f"{'; '.join(told)}. Uncertainties are {of} of white noise{instead}"


def _entry(fit: Fit, one: Component) -> dict[str, Any]:
    size, unit = _scale(fit, one)
    name, of = _named(one)
    return {
        "name": name,
        "of_what": of,
        "value": size * one.value,
        "sigma": size * one.sigma if math.isfinite(one.sigma) else None,
        "unit": unit,
        "p_value": one.p_value,
        "clear": one.p_value < CLEAR,
    }


def _named(one: Component) -> tuple[str, str]:
    """Name of a component for data, and of what it is."""
    if one.name in ("correlated", "walk", "visit", "scale"):
        return one.name, ""
    if one.name in (ADDED, ADDED_ANGLE, RANGE):
        return ("range" if one.name == RANGE else "added"), _ADDED[one.name][0]
    return "scale-of", f"{one.name} the beam" if one.name in (ALONG, ACROSS) else one.name


def _scale(fit: Fit, one: Component) -> tuple[float, str]:
    """Factor and unit of a component's value: s, a ratio, or the first actuator's unit."""
    if one.name == "correlated":
        return 1.0, "s"
    if one.name in _ADDED:
        return 1.0, _ADDED[one.name][1]
    if one.name != "visit":
        return 1.0, "1"
    axis = fit.model.rows.machine.axes[0]
    return axis.usual_error, axis.unit


_ADDED = {ADDED: ("lengths", "um"), ADDED_ANGLE: ("angles", "arcsec"), RANGE: ("lengths", "um/m")}
"""Of what readings something is added to the scatter, and its unit."""


def _says(fit: Fit, one: Component) -> str:
    if one.name in ("correlated", "walk"):
        return _in_time(fit, one)
    if one.name == "visit":
        return _of_visits(fit, one)
    if one.name == "scale":
        return f"readings scatter {_size(one.value, one.sigma)} times as much as sx, sy, sz say"
    name, of = _named(one)
    if name == "added":
        return (
            f"white noise of {_size(one.value, one.sigma, _ADDED[one.name][1])} comes on top "
            f"of what is stated of {of}"
        )
    if name == "range":
        return (
            "the scatter grows with range, beyond what is stated, by "
            f"{_size(one.value, one.sigma, 'um/m')} an axis"
        )
    times = f"scatter {_size(one.value, one.sigma)} times what is stated"
    if one.name in (ALONG, ACROSS):
        return f"{of} readings {times}"
    return f"readings of the {of} {times}"


def _in_time(fit: Fit, one: Component) -> str:
    if one.name == "walk":
        return (
            f"the noise wanders by {_size(one.value, one.sigma)} sigma from one reading to "
            "the next, and does not come back within the run"
        )
    noise = fit.noise
    alike = noise.share * float(np.exp(-fit.taking.usual_gap_s / one.value))
    return (
        f"the noise is correlated over {_time(one.value, one.sigma)} "
        f"({alike:.2f} between successive readings)"
    )


def _of_visits(fit: Fit, one: Component) -> str:
    size, unit = _scale(fit, one)
    factor, unit = (1000.0, "um") if unit == "mm" else (1e6, "urad")
    value, sigma = factor * size * one.value, factor * size * one.sigma
    return (
        "each visit of a pose errs as a whole, every actuator by "
        f"{_size(value, sigma, unit)}: "
        "the machine repeats no better, or depends on the pose in a way that no column shows "
        "(poses that are visited twice tell)"
    )


def _time(value: float, sigma: float) -> str:
    if value >= 120.0:
        return _size(value / 60.0, sigma / 60.0, "min")
    return _size(value, sigma, "s")


def _size(value: float, sigma: float, unit: str = "") -> str:
    """A value with its uncertainty; about so large where the readings do not bound it."""
    if math.isfinite(sigma):
        return plus_minus(value, sigma, unit)
    return f"about {value:.2g} {unit}".rstrip()
