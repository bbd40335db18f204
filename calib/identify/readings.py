"""Readings that cannot be right: the wrong hole, and strays. Flagged with a reason, never dropped.

A gross fault is seen before the fit, against the nominal machine: the tracker saw the SMR where
another nest stands, or where none is. A smaller stray is seen in the fit: letting that one reading
move freely lowers chi-square by d = e^T (I - H_ii)^-1 e (e whitened, H_ii its block of the hat
matrix). d/3 is compared with the misfit of all the others, so that a missing effect, which bends
every reading, does not make bad readings of good ones.
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, BoolArray, IntArray, parts_of
from calib.chance import f_rarer_than
from calib.digits import length
from calib.runs.stack import Rows
from calib.scaled import Scaled

FALSE_ALARM = 1e-3
"""Probability that a run without a stray has a reading flagged."""
MASKED = "masked by the operator"
"""Said of readings that were left out on purpose."""
MOST_STRAYS = 0.1
"""Part of the readings beyond which misfit is no matter of single readings."""


@dataclass(frozen=True)
class BadReading:
    """A reading that is excluded: its index among the rows, its line, and why."""

    row: int
    run: int
    line: int
    why: str


def wrong_place(rows: Rows, row: int, expected: dict[str, Array], slack: float) -> str:
    """Say where a reading that fits its label badly belongs.

    Parameters
    ----------
    rows : Rows
    row : int
        Which reading.
    expected : dict of (3,)
        Where each nest stood at that moment, tracker frame, by the nominal machine, mm.
    slack : float
        How far, in mm, the nominal machine may be off.
    """
    label = rows.nest_name[row]
    apart = {n: float(np.linalg.norm(rows.position[:, row] - p)) for n, p in expected.items()}
    nearest = min(apart, key=lambda name: apart[name])
    if nearest != label and apart[nearest] < slack:
        return f"reads as nest {nearest}, was labelled {label}"
    return f"{length(apart[label])} from where nest {label} is, and in no other nest"


def strays(
    whitened: Array,
    jacobian: Array,
    prior_precision: Array,
    candidates: BoolArray,
    components: IntArray | None = None,
) -> list[int]:
    """Find strays among accepted readings, worst first, each judged without those before it.

    Parameters
    ----------
    whitened : (3, N)
        Residuals in sigmas at the optimum of the fit to ``candidates``.
    jacobian : (p, 3, N)
        Whitened derivatives.
    prior_precision : (p,)
        1 / sigma^2 of the priors.
    candidates : (N,) bool
        Readings in the fit.
    components : (N,), optional
        How many components each reading holds, if not three.
    """
    accepted = candidates.copy()
    if components is None:
        components = np.full(accepted.size, 3, dtype=np.intp)
    normal = np.diag(prior_precision)
    for part in parts_of(accepted):
        block = jacobian[:, :, part].reshape(jacobian.shape[0], -1)
        normal = normal + block @ block.T
    step = np.zeros(jacobian.shape[0])
    found: list[int] = []
    while len(found) < MOST_STRAYS * candidates.sum():
        index, moved = _worst(whitened, jacobian, normal, step, accepted, components)
        if index is None:
            break
        found.append(index)
        accepted[index] = False
        block = jacobian[:, :, index]
        normal = normal - block @ block.T
        step = moved
    return found


def _worst(
    whitened: Array,
    jacobian: Array,
    normal: Array,
    step: Array,
    accepted: BoolArray,
    components: IntArray,
) -> tuple[int | None, Array]:
    """Most suspicious reading, or None; and the step of the fit once it is left out."""
    inverse = Scaled.of(normal).inverse()
    count = accepted.size
    hat = np.empty((count, 3, 3))
    for part in parts_of(np.ones(count, dtype=bool)):
        block = jacobian[:, :, part]
        spread = (inverse @ block.reshape(block.shape[0], -1)).reshape(block.shape)
        hat[part] = np.einsum("pin,pjn->nij", block, spread)
    residual = (whitened - np.tensordot(step, jacobian, axes=1)).T
    freed = np.linalg.solve(np.eye(3) - hat, residual[:, :, None])[:, :, 0]
    drop = np.where(accepted, np.sum(residual * freed, axis=1), 0.0)
    total = float(np.sum(residual[accepted] ** 2)) + 0.0
    dof = float(components[accepted].sum()) - float(np.einsum("nii->n", hat)[accepted].sum())
    # A height is compared with its one component, a point with its three.
    own = np.maximum(components, 1)
    worst = int(np.argmin(_log_chance(drop, own, max(total, 1.0), dof)))
    size = int(own[worst])
    others = max((total - drop[worst]) / max(dof - size, 1.0), 1.0)
    ratio = drop[worst] / size / others
    if not f_rarer_than(FALSE_ALARM / count, size, max(dof - size, 1.0), ratio):
        return None, step
    return worst, step - inverse @ jacobian[:, :, worst] @ freed[worst]


def _log_chance(drop: Array, own: IntArray, total: float, dof: float) -> Array:
    """How unlikely (N,) each drop of chi-square is, up to what all share: less is less likely.

    Where all readings hold as many components the largest drop is the least likely one.
    """
    if np.all(own == own[0]):
        return -drop
    scaled = drop / max(total / max(dof, 1.0), 1.0)
    return np.asarray(-0.5 * scaled + 0.5 * own + 0.5 * own * np.log(np.maximum(scaled / own, 1.0)))
