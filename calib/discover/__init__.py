"""Statistics of discovery: which effect is missing, how sure, and what it cannot be told from.

The core knows no machine. It takes a :class:`LinearProblem` (whitened residual of a fit and the
whitened derivatives of everything fitted, with priors) and :class:`Candidate` s (named groups of
whitened columns, one block for each trial of a nonlinear unknown), and answers a
:class:`Diagnosis`.
"""

from calib.discover.candidate import Candidate, Term, fill_missing
from calib.discover.diagnosis import diagnose
from calib.discover.findings import Diagnosis, Finding, Unexplained
from calib.discover.forward import Discovery, Stage, Step, discover
from calib.discover.problem import LinearProblem
from calib.discover.quadratic import Blocks, Neighbours, blocks_of
from calib.discover.repeats import PureError, pure_error
from calib.discover.structure import Carrier, Variable, structure_candidates

__all__ = [
    "Blocks",
    "Candidate",
    "Carrier",
    "Diagnosis",
    "Discovery",
    "Finding",
    "LinearProblem",
    "Neighbours",
    "PureError",
    "Stage",
    "Step",
    "Term",
    "Unexplained",
    "Variable",
    "blocks_of",
    "diagnose",
    "discover",
    "fill_missing",
    "pure_error",
    "structure_candidates",
]
