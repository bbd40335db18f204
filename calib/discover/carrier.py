"""What moves by structure of unknown origin, how far, how often and which way."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from calib.discover.problem import LEGS
from calib.evidence.findings import Dependence
from calib.identify.fitting import Fit

ONE_WAY = 0.9
"""Part of a wave's power along one direction from which it is said to go one way."""


def carriers(dependences: tuple[Dependence, ...], axes: Sequence[str]) -> list[dict[str, Any]]:
    """Entry ``carriers``: one for each dependence that has one, strongest first.

    ``axes`` are the names of the machine's actuators.
    """
    return [_entry(one, axes) for one in dependences if one.carrier]


def axes_of(fit: Fit) -> list[str]:
    """Names of the machine's actuators."""
    return [axis.name for axis in fit.model.machine.axes]


def mover(one: Dependence, axes: Sequence[str]) -> str:
    """What moves: the one actuator, by its name, where one alone acts."""
    if not one.carrier.startswith("leg"):
        return one.carrier
    acting = {name.removeprefix(f"{one.channel}.").split(".")[0] for name in one.acting}
    if one.carrier != LEGS:
        acting = {one.carrier}
    numbers = {name.removeprefix(LEGS).removeprefix("leg") for name in acting}
    if len(numbers) != 1 or not (number := numbers.pop()).isdigit():
        return one.carrier
    return axes[int(number) - 1]


def _entry(one: Dependence, axes: Sequence[str]) -> dict[str, Any]:
    size, direction = motion(one)
    return {
        "channel": one.channel,
        "moves": mover(one, axes),
        "period": one.period,
        "amplitude": size,
        "unit": one.unit,
        "direction": direction,
        "log_evidence": one.log_evidence,
    }


def motion(one: Dependence) -> tuple[float | None, list[float] | None]:
    """Amplitude of a wave of points, and its direction in the tracker frame if it goes one way.

    Sines and cosines of x, y, z are the two columns of a matrix of which the first singular vector
    is the direction; its power is its share of both.
    """
    whole = len(one.estimates) == 6 and one.carrier == "point"
    if one.period is None:
        return None, None
    if not whole:
        return (float(np.hypot(*one.estimates)) if len(one.estimates) == 2 else None), None
    waves = np.array(one.estimates).reshape(2, 3).T
    left, sizes, _ = np.linalg.svd(waves, full_matrices=False)
    if sizes[0] ** 2 < ONE_WAY * np.sum(sizes**2):
        return float(np.sqrt(np.sum(sizes**2))), None
    along = left[:, 0] * np.sign(left[np.argmax(np.abs(left[:, 0])), 0])
    return float(sizes[0]), [float(each) for each in along]


def motion_words(one: Dependence, axes: Sequence[str]) -> str:
    """How far what moves, and which way, after the period; empty where there is nothing to say."""
    size, direction = motion(one)
    if size is None:
        return ""
    length = f"{1000.0 * size:.2g} um" if one.unit == "mm" else f"{size:.2g} {one.unit}"
    if direction is None:
        which = mover(one, axes)
        return f", {length} of {which}" if which in axes else f", {length}"
    where = ", ".join(f"{each:.2f}" for each in direction)
    return f", {length} along one direction of the tracker frame ({where})"
