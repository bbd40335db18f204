"""Statistics of discovery: which effect is missing, how sure, and what it cannot be told from.

It knows no machine. It takes a :class:`LinearProblem` (whitened residual of a fit and the
whitened derivatives of everything fitted, with priors) and :class:`Candidate` s (named groups of
whitened columns, one block for each trial of a nonlinear unknown), and answers a
:class:`Diagnosis`. What a name needs is loaded when it is first used: a fit asks for little of it.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from calib.evidence.candidate import Candidate as Candidate
    from calib.evidence.candidate import fill_missing as fill_missing
    from calib.evidence.columns import Columns as Columns
    from calib.evidence.diagnosis import diagnose as diagnose
    from calib.evidence.findings import Diagnosis as Diagnosis
    from calib.evidence.findings import Finding as Finding
    from calib.evidence.findings import Unexplained as Unexplained
    from calib.evidence.forward import Discovery as Discovery
    from calib.evidence.forward import Revision as Revision
    from calib.evidence.forward import Stage as Stage
    from calib.evidence.forward import discover as discover
    from calib.evidence.problem import LinearProblem as LinearProblem
    from calib.evidence.quadratic import Neighbours as Neighbours
    from calib.evidence.quadratic import RigidBlocks as RigidBlocks
    from calib.evidence.quadratic import rigid_blocks as rigid_blocks
    from calib.evidence.repeats import PureError as PureError
    from calib.evidence.repeats import pure_error as pure_error
    from calib.evidence.structure import Response as Response
    from calib.evidence.structure import Variable as Variable
    from calib.evidence.structure import structure_candidates as structure_candidates

_HOMES = {
    "Candidate": "candidate",
    "Columns": "columns",
    "Diagnosis": "findings",
    "Discovery": "forward",
    "Finding": "findings",
    "LinearProblem": "problem",
    "Neighbours": "quadratic",
    "PureError": "repeats",
    "Response": "structure",
    "Revision": "forward",
    "RigidBlocks": "quadratic",
    "Stage": "forward",
    "Unexplained": "findings",
    "Variable": "structure",
    "diagnose": "diagnosis",
    "discover": "forward",
    "fill_missing": "candidate",
    "pure_error": "repeats",
    "rigid_blocks": "quadratic",
    "structure_candidates": "structure",
}

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


def __getattr__(name: str) -> Any:
    """Load a public name when it is first used."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"calib.evidence.{_HOMES[name]}"), name)
    globals()[name] = value
    return value
