"""Extensions where there are more actuators than commanded coordinates.

A step ds (n,) of the actuators must remove the task error e (k,), k < n: A ds = e with A the answer
of the commanded coordinates. That leaves n - k directions. Actuators that pull against one another
(redundant legs) are set so that the limbs strain least, |rho + R ds| with rho the strained rows of
the closure and R their answer; what is free even then (the elbow of a seven-axis arm) moves least,
|ds / u| with u the actuators' units.
"""

import numpy as np

from calib.arrays import Array, Numbers

FREE = 1e-9
"""Answer of the strained rows, as a part of the largest of all, below which nothing strains."""


def extension_steps(
    answer: Numbers, error: Numbers, strained: Numbers, straining: Numbers, units: Array
) -> Array:
    """Steps of the actuators, (n, N).

    Parameters
    ----------
    answer, error : (k, n, N), (k, N)
        Change of the commanded coordinates with each actuator, and what they lack.
    strained, straining : (m, N), (m, n, N)
        Rows of the closure at its equilibrium, zero where nothing strains, and their change with
        each actuator, the platform following.
    units : (n,)
        What counts as one of each actuator.
    """
    A = np.moveaxis(np.real(answer), -1, 0) * units
    fine = np.all(np.isfinite(A), axis=(1, 2))
    A = np.where(fine[:, None, None], A, 0.0)
    left, sizes, right = np.linalg.svd(A)
    count = A.shape[1]
    kept = sizes > 1e-12 * sizes[:, :1]
    inverse = np.where(kept, 1.0 / np.where(kept, sizes, 1.0), 0.0)
    e = np.where(fine, np.real(error), 0.0).T
    along = inverse * np.einsum("ntk,nt->nk", left, e)
    step = np.einsum("nka,nk->na", right[:, :count], along)
    free = np.swapaxes(right[:, count:], 1, 2)
    R = np.moveaxis(np.real(straining), -1, 0) * units
    R = np.where(np.isfinite(R), R, 0.0)
    rho = np.where(np.isfinite(strained), np.real(strained), 0.0).T
    size = np.linalg.norm(R, axis=(1, 2)) + 1e-300
    inner = np.einsum("nma,naf->nmf", R, free)
    pull = rho + np.einsum("nma,na->nm", R, step)
    # Where nothing strains the inner matrix is rounding alone: it has no inverse to speak of.
    inner = np.where((np.linalg.norm(inner, axis=(1, 2)) > FREE * size)[:, None, None], inner, 0.0)
    relax = -np.einsum("nfm,nm->nf", np.linalg.pinv(inner, rcond=1e-6), pull)
    step = step + np.einsum("naf,nf->na", free, relax)
    return np.where(fine, step.T, np.nan) * units[:, None]
