"""Jumps of commands made easy: lost motion is taken up over a while, as drives can follow it.

Where an actuator turns, its command jumps by its lost motion from one pose of a stream to the next.
A drive that takes set-points a millisecond apart cannot do that. What jumps is spread over as many
poses as an acceleration allows, about the pose at which it belongs: at even acceleration, then even
deceleration. Meanwhile the actuator is off by half of the jump at most; it turns there, slowly.
"""

import numpy as np

from calib.arrays import Array

STEEPEST = 0.1
"""Growth of what effects add, per unit of way, beyond which it is a jump and no trend."""


def eased(
    extension: Array, plain: Array, period_s: float, acceleration: Array, motion: Array
) -> Array:
    """Commands (n, N) in which nothing jumps by more than an acceleration allows.

    Parameters
    ----------
    extension, plain : (n, N)
        Commands ``period_s`` apart, and those by the geometry alone; mm or rad.
    acceleration : (n,)
        With which each actuator may take up a jump, mm/s^2 or rad/s^2.
    motion : (n,)
        Changes up to this are rounding.

    Returns
    -------
    (n, N)
        The same but for the poses near a jump. Near the first and the last pose it is taken up
        after the one and before the other; where there are too few poses for it, over all of them.
    """
    found, count = extension.copy(), extension.shape[1]
    steps = np.diff(extension - plain, axis=1)
    jumps = np.abs(steps) > STEEPEST * np.abs(np.diff(plain, axis=1)) + motion[:, None]
    for actuator, row in np.argwhere(jumps):
        jump = steps[actuator, row]
        width = 2.0 * np.sqrt(abs(jump) / acceleration[actuator]) / period_s
        begin = min(max(row + 0.5 - 0.5 * width, 0.0), max(count - 1.0 - width, 0.0))
        share = np.clip((np.arange(count) - begin) / min(width, count - 1.0), 0.0, 1.0)
        taken = np.where(share < 0.5, 2.0 * share**2, 1.0 - 2.0 * (1.0 - share) ** 2)
        found[actuator] += jump * (taken - (np.arange(count) > row))
    return found
