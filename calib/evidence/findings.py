"""Records of a diagnosis: what was found of each candidate, and what none explains."""

from collections.abc import Callable
from dataclasses import dataclass, field

from calib.arrays import Array
from calib.evidence.family import Family, p_of
from calib.evidence.scores import Scores
from calib.unknown import Estimate


@dataclass(frozen=True, eq=False)
class Finding:
    """What is known of one candidate.

    Attributes
    ----------
    index : int
        Its place among the candidates that were given.
    log_p, p_value : float
        Family-wise.
    log_evidence : float
        Log Bayes factor against "nothing missing"; candidates are ranked by it.
    chi2_fall, dof : float, int
        Fall of chi-square if the hypothesis with the most evidence is added, and its freedom.
    trial : tuple of float
        Values of the nonlinear unknowns with the most evidence.
    acting : tuple of str
        Unknowns of the hypothesis with the most evidence (one leg, or all).
    estimates : tuple of Estimate
        All linear unknowns of the group at that trial.
    visible : float
        Of its signature, the part that the fit has not taken; a ratio of norms, without priors.
    signature : (R,)
        Whitened displacement of the readings by the hypothesis with the most evidence.
    """

    index: int
    name: str
    log_p: float
    log_evidence: float
    chi2_fall: float
    dof: int
    trial: tuple[float, ...]
    acting: tuple[str, ...]
    estimates: tuple[Estimate, ...]
    visible: float
    signature: Array

    @property
    def p_value(self) -> float:
        """Family-wise p-value, no smaller than 1e-300."""
        return p_of(self.log_p)


@dataclass(frozen=True)
class Dependence:
    """A state variable on which the residual depends; ``period`` where a periodic one is best.

    ``carrier`` is what it moves, ``estimates`` the amplitudes of what moves it, (k,), as named by
    ``acting``, in ``unit``.
    """

    channel: str
    log_p: float
    log_evidence: float
    period: float | None = None
    carrier: str = ""
    acting: tuple[str, ...] = ()
    estimates: tuple[float, ...] = ()
    unit: str = ""


@dataclass(frozen=True)
class Unexplained:
    """Structure that no candidate explains, the channels with the most evidence first."""

    significant: bool
    log_p: float
    dependences: tuple[Dependence, ...] = ()

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the state variables."""
        return tuple(dict.fromkeys(found.channel for found in self.dependences))


@dataclass(frozen=True, eq=False)
class Joined:
    """What joined the linearised fit in a diagnosis: columns (k, R), prior precision (k,)."""

    name: str
    log_evidence: float
    columns: Array
    precision: Array


Groups = tuple[tuple[str, ...], ...]


class Rivals:
    """What a run cannot tell apart: made once, when it is asked for, or never."""

    def __init__(self, make: Callable[[], Groups]) -> None:
        self._make: Callable[[], Groups] | None = make
        self._told: Groups | None = None

    def told(self) -> Groups:
        """The answer; what it was made from is then let go."""
        if self._told is None:
            if self._make is None:
                raise ValueError("what it would be made from has been let go")
            self._told = self._make()
        self._make = None
        return self._told

    def forget(self) -> None:
        """Let go of what it would be made from."""
        self._make = None


@dataclass(frozen=True, eq=False)
class Diagnosis:
    """Answer to "what is missing?".

    Attributes
    ----------
    findings : tuple of Finding
        Every candidate, most evidence first.
    explained_by : tuple of str
        Candidates that one after the other were significant; empty if none.
    rivals : Rivals
        Makes ``indistinguishable``, when that is asked for.
    unexplained : Unexplained
    unknown_preferred : bool
        The residual is explained better by structure of unknown origin than by any candidates.
    adequate : bool
        Nothing is significant.
    scatter : float
        Variance of the readings beyond what was stated, once everything significant is in; 1 is
        as stated.
    joined : tuple of Joined
        ``explained_by`` as columns of the linearised fit.
    structure : Joined or None
        Structure with the most evidence, of what is significant beside them.
    quadratic_log_p : tuple of float
        log p of each quadratic test on its own, before anything joined.
    """

    findings: tuple[Finding, ...]
    explained_by: tuple[str, ...]
    rivals: Rivals = field(repr=False)
    unexplained: Unexplained
    unknown_preferred: bool
    adequate: bool
    scatter: float
    scores: Scores = field(repr=False)
    family: Family = field(repr=False)
    joined: tuple[Joined, ...] = field(default=(), repr=False)
    structure: Joined | None = field(default=None, repr=False)
    quadratic_log_p: tuple[float, ...] = ()

    @property
    def indistinguishable(self) -> Groups:
        """For each effect that was significant, itself first, what this run cannot tell it from.

        Those from which it would tell it with a probability below 0.8.
        """
        return self.rivals.told()

    def release(self) -> None:
        """Hold no columns nor null draws: what was asked by now is known, and nothing more."""
        self.rivals.forget()
        self.scores.release()

    @property
    def best(self) -> Finding | None:
        """The effect to add, or None if nothing known is called for."""
        if self.unknown_preferred or not self.explained_by:
            return None
        return next(found for found in self.findings if found.name == self.explained_by[0])
