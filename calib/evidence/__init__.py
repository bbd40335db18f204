"""Statistics of discovery: which effect is missing, how sure, and what it cannot be told from.

It knows no machine. It takes a :class:`LinearProblem` (whitened residual of a fit and the
whitened derivatives of everything fitted, with priors) and :class:`Candidate` s (named groups of
whitened columns, one block for each trial of a nonlinear unknown), and answers a
:class:`Diagnosis`.
"""

from calib.evidence.candidate import Candidate, fill_missing
from calib.evidence.columns import Columns
from calib.evidence.diagnosis import diagnose
from calib.evidence.findings import Diagnosis, Finding, Unexplained
from calib.evidence.forward import Discovery, Revision, Stage, discover
from calib.evidence.problem import LinearProblem
from calib.evidence.quadratic import Neighbours, RigidBlocks, rigid_blocks
from calib.evidence.repeats import PureError, pure_error
from calib.evidence.structure import Response, Variable, structure_candidates

__all__ = [
    "Candidate",
    "Columns",
    "Diagnosis",
    "Discovery",
    "Finding",
    "LinearProblem",
    "Neighbours",
    "PureError",
    "Response",
    "Revision",
    "RigidBlocks",
    "Stage",
    "Unexplained",
    "Variable",
    "diagnose",
    "discover",
    "fill_missing",
    "pure_error",
    "rigid_blocks",
    "structure_candidates",
]
