"""Does every actuator move the platform as the machine is drawn? Small moves, one after the other.

A drive knows nothing of the machine: a wrong sign, nodes that are exchanged or a wrong number of
counts look right to it. A nest on the platform that is measured before and after a small move of
one actuator alone shows them before any large move is made.
"""

from collections.abc import Sequence

import numpy as np

from calib.arrays import Array
from calib.mechanism.description import Machine
from calib.mechanism.solve import forward

SMALL_MM = 1.0
"""How far the nest is to move."""
OF_STROKE = 0.02
"""And how much of its stroke an actuator may make for it."""
PROBE = 1e-4
ALIKE = 0.3
"""Part of a displacement by which it may differ from the drawn one: errors of a machine that was
never calibrated are far smaller, those that are looked for far larger."""
SIGMAS = 6.0


def displacements(
    machine: Machine, parameters: Array, extension: Array, nest: Array, ways: Array
) -> Array:
    """How far a nest goes when each actuator alone makes its way: base frame, mm, (3, n).

    Parameters
    ----------
    parameters : array, shape (P,)
    extension : array, shape (n,)
        Where the machine stands, mm or rad.
    nest : array, shape (3,)
        On the platform, mm.
    ways : array, shape (n,)
        mm or rad.

    Returns
    -------
    array, shape (3, n)
        nan where the machine does not close with that actuator alone moved.
    """
    moved = np.concatenate([extension[:, None], extension[:, None] + np.diag(ways)], axis=1)
    closed = forward(machine, moved, parameters)
    places = closed.poses.position + np.einsum("ijn,j->in", closed.poses.rotation, nest)
    places = np.where(closed.converged, places, np.nan)
    change: Array = places[:, 1:] - places[:, :1]
    return change


def small_ways(machine: Machine, parameters: Array, extension: Array, nest: Array) -> Array:
    """Ways (n,) of the actuators that move the nest by about :data:`SMALL_MM`, mm or rad."""
    strokes = np.diff(machine.q_limits, axis=1)[:, 0]
    probe = PROBE * strokes
    rates = np.linalg.norm(displacements(machine, parameters, extension, nest, probe), axis=0)
    wanted = SMALL_MM * probe / np.maximum(rates, 1e-12)
    ways: Array = np.minimum(np.nan_to_num(wanted), OF_STROKE * strokes)
    return ways


def complaints(
    names: Sequence[str], drawn: Array, seen: Array, sigma_mm: float
) -> tuple[list[str], list[str]]:
    """What is wrong with each actuator, and which were too small a move to say.

    Parameters
    ----------
    drawn, seen : array, shape (3, n)
        How far the nest should go and went, mm, in one frame.
    sigma_mm : float
        Standard uncertainty of a difference of two readings.
    """
    wrong, unsaid = [], []
    for n, name in enumerate(names):
        length = float(np.linalg.norm(drawn[:, n]))
        allowed = ALIKE * length + SIGMAS * sigma_mm
        if not length > 2.0 * SIGMAS * sigma_mm:  # nan where the machine does not close
            unsaid.append(name)
        elif not _near(seen[:, n], drawn[:, n], allowed):
            wrong.append(_what(n, names, drawn, seen[:, n], allowed))
    return wrong, unsaid


def _near(one: Array, other: Array, allowed: float) -> bool:
    return bool(np.linalg.norm(one - other) <= allowed)


def _what(n: int, names: Sequence[str], drawn: Array, seen: Array, allowed: float) -> str:
    name, length = names[n], float(np.linalg.norm(drawn[:, n]))
    went = float(np.linalg.norm(seen))
    if went <= allowed:
        return f"{name} does not move the platform ({went:.3f} mm, drawn {length:.3f} mm)"
    if _near(seen, -drawn[:, n], allowed):
        return f"{name} moves the wrong way: its sign"
    along = float(seen @ drawn[:, n]) / (went * length)
    if abs(along) > np.cos(ALIKE):
        backwards = ", and the wrong way" if along < 0.0 else ""
        return f"{name} moves {went / length:.3g} times as far as told{backwards}: its counts"
    others = [
        other
        for k, other in enumerate(names)
        if k != n and min(_off(seen, drawn[:, k]), _off(seen, -drawn[:, k])) <= ALIKE * length
    ]
    if others:
        return f"{name} moves the platform as {others[0]} would: their nodes are exchanged"
    return f"{name} moves a nest by {went:.3f} mm elsewhere than drawn ({length:.3f} mm)"


def _off(one: Array, other: Array) -> float:
    return float(np.linalg.norm(one - other))
