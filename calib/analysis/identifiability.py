"""Which unknowns readings can tell apart: rank, base parameters, groups, what stays unknown.

Two questions are kept apart. *Exactly*: are there combinations of unknowns that change no reading
at all? That is the rank of the readings' Jacobian. *In practice*: which combinations do the
readings pin down better than the drawing does? That depends on noise and tolerances; an unknown
counts as identified if its prior standard deviation is more than halved.
"""

from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr

from calib.analysis.observation import Observation
from calib.arrays import Array

EXACT = 1e-11
"""Singular value, relative to the largest, below which a combination is exactly invisible.

Rounding leaves 1e-16 .. 1e-14; the weakest combination that offsets of a few millimetres keep
visible has 1e-6."""
HALVED = 0.5
COUPLED = 0.2
"""Coefficient in the projector on unseen combinations from which two unknowns count as coupled."""
RELATED = 1e-6
"""Coefficient of an exact relation that is more than rounding."""


@dataclass(frozen=True)
class Relation:
    """An unknown whose effect is exactly that of others: a change of ``name`` looks like the
    changes ``like`` = ((other, factor), ...), in their own units."""

    name: str
    like: tuple[tuple[str, float], ...]


@dataclass(frozen=True, eq=False)
class Identifiability:
    """What readings at some poses can tell.

    Attributes
    ----------
    names : tuple of str
    rank : int
        Number of independent combinations.
    singular_values : (p,)
        Of the Jacobian in units of priors and noise, largest first.
    base : tuple of str
        As many unknowns as the rank that are independent: they may be fitted without priors.
    relations : tuple of Relation
        The others, each by its base parameters.
    exact_groups, practical_groups : tuple of tuple of str
        Unknowns that cannot be told from each other: not at all, and not better than tolerances
        tell them.
    sigma_ratio : (p,)
        Standard uncertainty after the readings, in units of the prior's.
    identified : tuple of bool
    covariance : (p, p)
        After the readings, with priors, in scaled units.
    """

    names: tuple[str, ...]
    rank: int
    singular_values: Array
    base: tuple[str, ...]
    relations: tuple[Relation, ...]
    exact_groups: tuple[tuple[str, ...], ...]
    practical_groups: tuple[tuple[str, ...], ...]
    sigma_ratio: Array
    identified: tuple[bool, ...]
    covariance: Array

    @property
    def smallest_kept(self) -> float:
        """Smallest singular value that counts for the rank, relative to the largest."""
        s = self.singular_values
        return float(s[self.rank - 1] / s[0]) if self.rank else 0.0

    @property
    def weak(self) -> int:
        """Combinations that are visible, but less sharply than the tolerances know them."""
        kept = self.singular_values[: self.rank]
        return int(np.sum(kept < np.sqrt(1.0 / HALVED**2 - 1.0)))


def identifiability(observation: Observation) -> Identifiability:
    """Analyse the readings' Jacobian."""
    A, names = observation.A, observation.names
    norms = np.linalg.norm(A, axis=0)
    safe = np.where(norms > 0.0, norms, 1.0)
    values: Array = np.linalg.svd(A, compute_uv=False).astype(float)
    values = np.concatenate([values, np.zeros(max(0, len(names) - len(values)))])
    # Columns of equal length: a small unit must not pass for a missing freedom.
    rank = exact_rank(A / safe)
    relations, base = _base_parameters(A / safe, observation.scale / safe, names, rank)
    covariance = posterior(observation)
    ratio = np.sqrt(np.diag(covariance))
    return Identifiability(
        names=names,
        rank=rank,
        singular_values=values,
        base=base,
        relations=relations,
        exact_groups=_groups(names, [(r.name, *(n for n, _ in r.like)) for r in relations]),
        practical_groups=_practical_groups(observation, covariance),
        sigma_ratio=ratio,
        identified=tuple(bool(r < HALVED) for r in ratio),
        covariance=covariance,
    )


def exact_rank(A: Array) -> int:
    """Number of singular values above rounding."""
    values = np.linalg.svd(A, compute_uv=False)
    return int(np.sum(values > EXACT * values[0])) if values.size and values[0] > 0.0 else 0


def posterior(observation: Observation) -> Array:
    """Covariance (p, p) of the unknowns in their scaled units after the readings, with priors.

    Where nothing is known beforehand (frames) the prior is 1e4 of the unit wide.
    """
    A = observation.A
    prior = np.where(observation.prior > 0.0, 1.0, 1e-4)
    _, values, Vt = np.linalg.svd(A / prior, full_matrices=True)
    # C = D (I + B^T B)^-1 D with B = A D, D = 1 / prior: every eigenvalue is between 0 and 1.
    filled = np.zeros(len(prior))
    filled[: len(values)] = values
    half = Vt / np.sqrt(1.0 + filled**2)[:, None] / prior
    C: Array = half.T @ half
    return C


def _base_parameters(
    A: Array, unit: Array, names: tuple[str, ...], rank: int
) -> tuple[tuple[Relation, ...], tuple[str, ...]]:
    """Independent unknowns by pivoted QR, and the rest in terms of them (Khalil's regrouping)."""
    if rank == 0:
        return tuple(Relation(name, ()) for name in names), ()
    _, R, pivot = qr(A, mode="economic", pivoting=True)
    base = [int(k) for k in pivot[:rank]]
    weights = np.linalg.solve(R[:rank, :rank], R[:rank, rank:])
    relations = []
    for j, k in enumerate(pivot[rank:]):
        held = [
            (names[b], float(weights[i, j] * unit[b] / unit[k]))
            for i, b in enumerate(base)
            if abs(weights[i, j]) > RELATED
        ]
        relations.append(Relation(names[k], tuple(held)))
    return tuple(relations), tuple(names[k] for k in sorted(base))


def _practical_groups(observation: Observation, covariance: Array) -> tuple[tuple[str, ...], ...]:
    """Unknowns coupled by combinations that the readings do not pin down to half of the prior."""
    values, vectors = np.linalg.eigh(covariance)
    unseen = vectors[:, values > HALVED**2]
    P = unseen @ unseen.T
    names = observation.names
    held = [k for k in range(len(names)) if P[k, k] > COUPLED]
    links: list[tuple[str, ...]] = [(names[k],) for k in held]
    links += [(names[i], names[j]) for i in held for j in held if i < j and abs(P[i, j]) > COUPLED]
    return _groups(names, links)


def _groups(names: tuple[str, ...], links: list[tuple[str, ...]]) -> tuple[tuple[str, ...], ...]:
    """Connected sets of linked names, in the order of ``names``."""
    leader = {name: name for link in links for name in link}

    def find(name: str) -> str:
        while leader[name] != name:
            leader[name] = leader[leader[name]]
            name = leader[name]
        return name

    for first, *rest in links:
        for other in rest:
            leader[find(other)] = find(first)
    sets: dict[str, list[str]] = {}
    for name in names:
        if name in leader:
            sets.setdefault(find(name), []).append(name)
    return tuple(tuple(members) for members in sets.values())
