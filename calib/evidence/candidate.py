"""What could be missing: a named group of columns, at one or several trial values."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.evidence.problem import LinearProblem


@dataclass(frozen=True)
class Term:
    """One linear unknown of a candidate.

    ``size`` is how large it may reasonably be, in ``unit``; it scales the columns, and with it
    the hypotheses are weighed. ``sigma`` is the standard deviation of its prior, None for none.
    """

    name: str
    unit: str = ""
    size: float = 1.0
    sigma: float | None = None


@dataclass(frozen=True, eq=False)
class Candidate:
    """A group of k unknowns that might be missing, with its signature.

    Attributes
    ----------
    name : str
    terms : tuple of k Term
        Its linear unknowns.
    columns : (T, k, R)
        Whitened derivatives of the prediction by each unknown, for each of T trials of the
        nonlinear unknowns (T = 1 if there are none).
    trials : tuple of T tuples
        Values of the nonlinear unknowns.
    subsets : tuple of tuples of int
        Which unknowns may act alone (one leg's backlash, say); each is a hypothesis of its own
        beside the whole group.
    channel : str
        For structure of unknown origin: the state variable that it depends on. Empty for effects.
    """

    name: str
    terms: tuple[Term, ...]
    columns: Array
    trials: tuple[tuple[float, ...], ...] = ((),)
    subsets: tuple[tuple[int, ...], ...] = field(default=())
    channel: str = ""

    def __post_init__(self) -> None:
        if self.columns.ndim != 3 or self.columns.shape[:2] != (len(self.trials), len(self.terms)):
            raise ValueError(
                f"{self.name}: columns have shape {self.columns.shape}, expected"
                f" ({len(self.trials)}, {len(self.terms)}, rows)"
            )
        if not np.isfinite(self.columns).all():
            raise ValueError(f"{self.name}: columns are not finite; see fill_missing")

    @cached_property
    def sizes(self) -> Array:
        """Sizes (k,) of the unknowns."""
        return np.array([term.size for term in self.terms])

    @cached_property
    def prior_precision(self) -> Array:
        """1 / sigma^2 (k,); where there is no prior, that of a thousand sizes."""
        sigma = [term.sigma or 1e3 * term.size for term in self.terms]
        return 1.0 / np.array(sigma) ** 2

    @cached_property
    def hypotheses(self) -> tuple[tuple[int, ...], ...]:
        """The whole group first, then every subset that is smaller."""
        whole = tuple(range(len(self.terms)))
        return (whole, *(subset for subset in dict.fromkeys(self.subsets) if subset != whole))

    @cached_property
    def by_count(self) -> tuple[IntArray, ...]:
        """Hypotheses (H, k) by their number k of unknowns, the whole group first."""
        counts = dict.fromkeys(len(subset) for subset in self.hypotheses)
        return tuple(
            np.array([one for one in self.hypotheses if len(one) == count], dtype=np.intp)
            for count in counts
        )


def alone(terms: tuple[Term, ...]) -> tuple[tuple[int, ...], ...]:
    """Subsets that may act alone: unknowns that share ``effect.member`` in their names.

    ``backlash.leg3`` is one, ``screw-cyclic.leg1.sin`` and ``.cos`` are one together.
    """
    groups: dict[str, list[int]] = {}
    for index, term in enumerate(terms):
        groups.setdefault(".".join(term.name.split(".")[:2]), []).append(index)
    if len(groups) < 2:
        return ()
    return tuple(tuple(members) for members in groups.values())


def fill_missing(problem: LinearProblem, columns: Array, missing: BoolArray) -> Array:
    """Leave rows out for one candidate only: columns (..., R) with ``missing`` (R,) rows replaced.

    Leaving rows m out equals freeing one unknown for each. That makes A' M vanish at m:
    with A zero at m, A'_m = -(A M)_m (M_mm)^-1, everything else of A unchanged.
    """
    columns = np.where(missing, 0.0, columns)
    if not missing.any():
        return columns
    projected = problem.project(columns)[..., missing]
    absorbed = problem.absorbed[:, missing]
    block = np.eye(int(missing.sum())) * (1.0 + 1e-9) - absorbed.T @ absorbed
    flat = projected.reshape(-1, projected.shape[-1])
    columns[..., missing] = -np.linalg.solve(block, flat.T).T.reshape(projected.shape)
    return columns
