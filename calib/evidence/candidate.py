"""What could be missing: a named group of columns, at one or several trial values."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
from calib.evidence.columns import Columns
from calib.evidence.problem import LinearProblem
from calib.unknown import Unknown


@dataclass(frozen=True, eq=False)
class Candidate:
    """A group of k unknowns that might be missing, with its signature.

    Attributes
    ----------
    name : str
    unknowns : tuple of k Unknown
        The linear ones.
    columns : Columns, (T, k, R)
        Whitened derivatives of the prediction by each unknown, for each of T trials of the
        nonlinear unknowns (T = 1 if there are none).
    trials : tuple of T tuples
        Values of the nonlinear unknowns.
    subsets : tuple of tuples of int
        Which unknowns may act alone (one leg's backlash, say); each is a hypothesis of its own
        beside the whole group.
    channel : str
        For structure of unknown origin: the state variable that it depends on. Empty for effects.
    between : callable, optional
        Columns (k, R) at a value between two trials of a scanned unknown.
    """

    name: str
    unknowns: tuple[Unknown, ...]
    columns: Columns
    trials: tuple[tuple[float, ...], ...] = ((),)
    subsets: tuple[tuple[int, ...], ...] = field(default=())
    channel: str = ""
    between: Callable[[float], Array] | None = None

    def __post_init__(self) -> None:
        if self.columns.shape[:2] != (len(self.trials), len(self.unknowns)):
            raise ValueError(
                f"{self.name}: columns have shape {self.columns.shape}, expected"
                f" ({len(self.trials)}, {len(self.unknowns)}, rows)"
            )

    @cached_property
    def sizes(self) -> Array:
        """Sizes (k,) of the unknowns."""
        return np.array([unknown.size for unknown in self.unknowns])

    @cached_property
    def prior_precision(self) -> Array:
        """1 / sigma^2 (k,); where there is no prior, that of a thousand sizes."""
        return 1.0 / np.array([unknown.prior_sigma for unknown in self.unknowns]) ** 2

    def changed(self, how: Callable[[Array], Array]) -> "Candidate":
        """The same with all columns (..., R) changed by ``how``."""
        at = self.between
        between = None if at is None else lambda period: how(at(period))
        return replace(self, columns=self.columns.changed(how), between=between)

    @cached_property
    def hypotheses(self) -> tuple[tuple[int, ...], ...]:
        """The whole group first, then every subset that is smaller."""
        whole = tuple(range(len(self.unknowns)))
        return (whole, *(subset for subset in dict.fromkeys(self.subsets) if subset != whole))

    @cached_property
    def by_count(self) -> tuple[IntArray, ...]:
        """Hypotheses (H, k) by their number k of unknowns, the whole group first."""
        counts = dict.fromkeys(len(subset) for subset in self.hypotheses)
        return tuple(
            np.array([one for one in self.hypotheses if len(one) == count], dtype=np.intp)
            for count in counts
        )


def fill_missing(
    problem: LinearProblem, columns: Array, missing: BoolArray, errors: Array | None = None
) -> Array:
    """Leave rows out for one candidate only: columns (..., R) with ``missing`` (R,) rows replaced.

    Leaving rows out equals freeing an error of each; ``errors`` (m, R) are their columns, unit
    vectors E where nothing is given, else what has become of these in readings that were freed of
    shared noise. That adds to A, zero at the rows, what makes A' M E^T vanish:
    A' = A - (A M E^T) (E M E^T)^-1 E.
    """
    if errors is None:
        columns = np.where(missing, 0.0, columns)
        errors = unit_errors(missing)
    if not missing.any():
        return columns
    projected = problem.project(errors)
    block = projected @ errors.T
    block[np.diag_indices_from(block)] *= 1.0 + 1e-9
    flat = columns.reshape(-1, columns.shape[-1])
    taken = np.linalg.solve(block, projected @ flat.T)
    return np.asarray((flat - taken.T @ errors).reshape(columns.shape))


def unit_errors(missing: BoolArray) -> Array:
    """One unit vector (m, R) for each of the rows ``missing`` (R,)."""
    where = np.flatnonzero(missing)
    errors = np.zeros((where.size, missing.size))
    errors[np.arange(where.size), where] = 1.0
    return errors
