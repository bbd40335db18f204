"""What could be missing: a named group of columns, at one or several trial values."""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from calib.arrays import Array, BoolArray, IntArray
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
    unknowns: tuple[Unknown, ...]
    columns: Array
    trials: tuple[tuple[float, ...], ...] = ((),)
    subsets: tuple[tuple[int, ...], ...] = field(default=())
    channel: str = ""

    def __post_init__(self) -> None:
        if self.columns.ndim != 3 or self.columns.shape[:2] != (
            len(self.trials),
            len(self.unknowns),
        ):
            raise ValueError(
                f"{self.name}: columns have shape {self.columns.shape}, expected"
                f" ({len(self.trials)}, {len(self.unknowns)}, rows)"
            )
        if not np.isfinite(self.columns).all():
            raise ValueError(f"{self.name}: columns are not finite; see fill_missing")

    @cached_property
    def sizes(self) -> Array:
        """Sizes (k,) of the unknowns."""
        return np.array([unknown.size for unknown in self.unknowns])

    @cached_property
    def prior_precision(self) -> Array:
        """1 / sigma^2 (k,); where there is no prior, that of a thousand sizes."""
        return 1.0 / np.array([unknown.prior_sigma for unknown in self.unknowns]) ** 2

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
