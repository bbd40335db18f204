"""What candidates are to a fit before anything is read: columns' norms, weights, whitening.

It hangs on the readings' places alone. Scores that differ in null draws share one.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from calib.arrays import Array
from calib.evidence.candidate import Candidate
from calib.evidence.weighing import Spectrum, Stack, Weighing, soft_test, spectrum_of, stacked

EVEN = 0.9
"""A group that is seen so evenly needs no test in which its directions weigh differently."""


@dataclass(frozen=True, eq=False)
class Weighed:
    """Candidates with their weights in a fit.

    Attributes
    ----------
    candidates : sequence of Candidate
    norms : list of (T, k)
        Norm of each column before projection.
    weights : list of (T, k, k)
        Unit columns times M times unit columns.
    """

    candidates: Sequence[Candidate]
    norms: list[Array]
    weights: list[Array]

    @cached_property
    def stacks(self) -> list[list[Stack]]:
        """For every candidate its hypotheses, those of equally many unknowns together."""
        return [
            [stacked(weight, chosen) for chosen in candidate.by_count]
            for candidate, weight in zip(self.candidates, self.weights, strict=True)
        ]

    @cached_property
    def softs(self) -> list[Stack | None]:
        """For every candidate its soft test; None where the whole group is seen evenly."""
        found: list[Stack | None] = []
        for index, (candidate, stacks) in enumerate(zip(self.candidates, self.stacks, strict=True)):
            soft = soft_test(self.spectrum(index)) if len(candidate.unknowns) > 1 else None
            even = soft is None or not np.any(soft.dof < EVEN * stacks[0].dof)
            found.append(None if even else soft)
        return found

    def spectrum(self, index: int) -> Spectrum:
        """A candidate's whole group in directions that the readings see apart."""
        if index not in self._spectra:
            size = self.norms[index] * self.candidates[index].sizes
            self._spectra[index] = spectrum_of(self.weights[index], size)
        return self._spectra[index]

    @cached_property
    def _spectra(self) -> dict[int, Spectrum]:
        return {}

    def weighing(self, index: int, number: int) -> Weighing:
        """The whitening of one hypothesis of a candidate."""
        subset = self.candidates[index].hypotheses[number]
        return next(
            stack.weighing(row)
            for stack in self.stacks[index]
            for row, chosen in enumerate(stack.chosen)
            if tuple(chosen) == subset
        )
