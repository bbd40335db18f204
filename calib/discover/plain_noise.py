"""The noise of a fit whose model is chosen: estimated where only noise is left to be explained.

Where chi-square is beyond what noise leaves, an effect may be missing, and only the whole diagnosis
tells it from noise: nothing is estimated then. Else the components of noise are those that the
diagnosis finds beside what it would call for, so that no effect passes for noise here either.
"""

import math
from collections.abc import Callable, Sequence

from calib.discover.agreement import neighbours_alike
from calib.effects.component import Effect
from calib.identify.fitting import Fit
from calib.noise import points_to_scatter

MOST = 3000
"""Readings up to which noise is estimated beside a fit: the diagnosis takes as long as a discovery
begins with."""
OFF = 3.1
"""Standard deviations by which chi-square is off, from which it is noise that is not as stated."""
CLEAR = 1e-3
"""p-value of a component up to which it is counted."""
SEED = 20_260_801


def with_own_noise(fit: Fit, catalogue: Callable[[], Sequence[Effect]]) -> Fit:
    """Count with the noise that the readings of a fit demand; mostly that is as stated.

    ``catalogue`` gives the candidates with which the noise must compete, if it is asked.
    """
    if not only_noise_is_off(fit):
        return fit
    from calib.discover.noise import judge  # a fit goes without

    answer = judge(fit, catalogue(), SEED)
    clear = any(one.p_value < CLEAR for one in answer.fit.components_of_noise)
    return answer.fit if clear else fit


def only_noise_is_off(fit: Fit) -> bool:
    """Whether a fit leaves no more than noise does, but not as the readings state it."""
    if not fit.dof > 0 or fit.readings > MOST or fit.whitening is not None:
        return False
    off = (fit.chi2 - fit.dof) / math.sqrt(2.0 * fit.dof)
    if off > OFF:
        return False
    if off < -OFF or neighbours_alike(fit) is not None:
        return True
    return points_to_scatter(fit.problem, fit.taking) < CLEAR
