"""What many machines of one type have in common: mean and spread of every parameter.

Machine i was fitted alone, with its tolerances as priors N(c, diag s^2): estimate e_i with
covariance C_i. Taking the prior off again leaves what its readings say,

    I_i = C_i^-1 - diag s^-2,      b_i = C_i^-1 e_i - diag s^-2 c,

and the machines are taken to be drawn from N(mu, diag t^2). mu and t are found by expectation and
maximisation (empirical Bayes; Dempster, Laird and Rubin 1977): with the population as prior each
machine is V_i = (I_i + diag t^-2)^-1, m_i = V_i (b_i + diag t^-2 mu); then

    mu_j = sum m_ij / (count + t_j^2 / s_j^2),
    t_j^2 = (w s_j^2 + sum_i V_ijj + (m_ij - mu_j)^2) / (count + w),

the tolerance counting as w = 5 machines: among many parameters that a few machines hardly tell
one would otherwise be found to scatter far beyond its tolerance, by chance. V_i and m_i at the end
are the machines with the priors of the fleet.

Whether a machine belongs to it: its estimate alone is linear in its readings, so that under the
population it is normal with mean C_i (I_i mu + diag s^-2 c) and covariance
C_i (I_i diag t^2 I_i + I_i) C_i. mu and t are those that the others give (one step without it), t
by few machines: the ratio is judged by Student's distribution of that many less two degrees of
freedom, over all machines and parameters together (Sidak).
"""

from dataclasses import dataclass

import numpy as np

from calib.arrays import Array, BoolArray
from calib.chance import f_above

STEPS = 200
"""Steps of expectation and maximisation at most."""
STILL = 1e-4
"""Change of mu over t, and of t over itself, below which the population is found."""
WEIGHT = 5.0
"""Machines that the tolerance counts as."""
FEWEST = 4
"""Machines below which none can be called an outlier."""


@dataclass(frozen=True, eq=False)
class Population:
    """A type of machine, as K machines show it.

    Attributes
    ----------
    mean, spread : (P,)
        mu and t of every parameter, in its unit.
    values : (K, P)
        The machines with the fleet's priors, and their
    covariance : (K, P, P)
    ratio : (K, P)
        How far each machine alone is from what the others and its readings let expect, over the
        standard deviation of that; zero where there are too few machines.
    chance : (K, P)
        Probability of a ratio that large, of this one alone.
    """

    mean: Array
    spread: Array
    values: Array
    covariance: Array
    ratio: Array
    chance: Array


def population(
    values: Array, covariance: Array, centre: Array, prior: Array, teach: BoolArray | None = None
) -> Population:
    """Learn a population from machines that were fitted alone.

    Parameters
    ----------
    values, covariance : (K, P), (K, P, P)
        Estimates with the tolerances as priors.
    centre, prior : (P,)
        Means and standard deviations of these priors.
    teach : (K,) bool, optional
        Machines from which is learnt, if not all: one whose readings the model does not explain
        has estimates that are farther off than their covariance says.
    """
    teach = np.ones(len(values), dtype=bool) if teach is None else teach
    whole = np.asarray(np.linalg.inv(covariance / prior / prior[:, None]))
    told = whole - np.eye(prior.size)  # I_i in units of the priors
    off = (values - centre) / prior
    said = np.einsum("kij,kj->ki", whole, off)
    mean, spread = np.zeros(prior.size), np.ones(prior.size)
    for _ in range(STEPS):
        means, covariances = _machines(told, said, mean, spread)
        own = np.asarray(np.einsum("kii->ki", covariances))
        found = _learnt(means[teach], own[teach], spread)
        moved = np.abs(found[0] - mean) / found[1] + np.abs(found[1] / spread - 1.0)
        mean, spread = found
        if moved.max(initial=0.0) < STILL:
            break
    means, covariances = _machines(told, said, mean, spread)
    own = np.asarray(np.einsum("kii->ki", covariances))
    ratio, chance = _apart(whole, told, off, (means, own), spread, teach)
    return Population(
        centre + prior * mean, prior * spread, centre + prior * means,
        covariances * prior[:, None] * prior, ratio, chance,
    )  # fmt: skip


def _machines(told: Array, said: Array, mean: Array, spread: Array) -> tuple[Array, Array]:
    """Machines (K, P) with the population as prior, and their covariances (K, P, P)."""
    narrow = spread[:, None] * spread
    # (I + T^-1)^-1 = t (t I t + 1)^-1 t stays well conditioned as t vanishes.
    covariance = np.linalg.inv(told * narrow + np.eye(spread.size)) * narrow
    means = np.einsum("kij,kj->ki", covariance, said + mean / spread**2)
    return means, covariance


def _learnt(means: Array, own: Array, spread: Array) -> tuple[Array, Array]:
    """Mean and spread (P,) of machines (K, P) with variances (K, P) of their own.

    ``spread`` (P,) is what it was before.
    """
    count = means.shape[0]
    mean = means.sum(axis=0) / (count + spread**2)
    squares = np.sum(own + (means - mean) ** 2, axis=0)
    return mean, np.sqrt((WEIGHT + squares) / (count + WEIGHT))


def _apart(
    whole: Array,
    told: Array,
    off: Array,
    machines: tuple[Array, Array],
    spread: Array,
    teach: BoolArray,
) -> tuple[Array, Array]:
    """Ratios and chances (K, P) of every machine against the others."""
    means, own = machines
    count, size = off.shape
    ratio, chance = np.zeros((count, size)), np.ones((count, size))
    for k in range(count):
        others = teach & (np.arange(count) != k)
        many = int(others.sum()) + 1
        if many < FEWEST:
            continue
        mean, apart = _learnt(means[others], own[others], spread)
        alone = np.linalg.inv(whole[k])
        through = alone @ told[k]
        expected = through @ mean
        # The mean of the others is known as well as they are many.
        variance = np.sum((through * apart) ** 2, axis=1) * (1.0 + 1.0 / (many - 1))
        variance += np.einsum("ij,ji->i", through, alone)
        ratio[k] = (off[k] - expected) / np.sqrt(variance)
        chance[k] = [beyond(float(one), many) for one in ratio[k]]
    return ratio, chance


def beyond(ratio: float, count: int) -> float:
    """P(|t| > ratio) for a machine of so many, judged by the spread of the others."""
    return f_above(1.0, count - 2.0, ratio**2)


def misfits(chi2: Array, dof: Array) -> tuple[Array, Array]:
    """How much worse each machine's readings are explained than the others', and chances, (K,).

    By the logarithm of chi-square per degree of freedom, over its spread among the others or what
    noise alone gives (variance 2 / dof), whichever is larger: where an effect is missing in all
    machines, none is named for it. One-sided.
    """
    count = chi2.size
    ratio, chance = np.zeros(count), np.ones(count)
    level = np.log(np.maximum(chi2, 1e-300) / dof)
    for k in range(count) if count >= FEWEST else ():
        others = np.arange(count) != k
        variance = max(float(np.var(level[others], ddof=1)), float(np.mean(2.0 / dof)))
        away = level[k] - level[others].mean()
        ratio[k] = away / np.sqrt(variance * (1.0 + 1.0 / (count - 1)))
        if ratio[k] > 0.0:
            chance[k] = 0.5 * beyond(float(ratio[k]), count)
    return ratio, chance


def family_wise(chance: float, looks: int) -> float:
    """Probability that one of so many independent looks shows what one alone does by chance."""
    return float(-np.expm1(looks * np.log1p(-min(chance, 1.0 - 1e-16))))
