"""What the truth says about an answer: power that was to be expected, likeness, pairs, pulls."""

from dataclasses import dataclass

import numpy as np

from bench._blind_cases import Case, displaced
from calib.discover.discovery import RunStage
from calib.evidence.bayes import observed
from calib.evidence.pairs import power, prefers
from calib.runs.stack import Rows

Vector = np.ndarray
OTHERWISE_DEFINED = ("frame-shift", "redundancy")
"""Effects that the mock states by other numbers: about another point, as a stiffness."""


@dataclass(frozen=True)
class Foreseen:
    """What one effect beyond a stage's model was to show in it, and what it did show.

    Attributes
    ----------
    power, detected
        Predicted probability that it is significant (for an unknown effect, that any structure
        is), and whether it was.
    likeness : float
        Largest cosine to a candidate's column space, after projection.
    rival : str
        The candidate to which it is likest, itself left out; "" for an unknown effect.
    told, preferred
        Predicted probability that it gets more evidence than the rival, and whether it did.
    reported : bool
        Whether the two stand in one group of the diagnosis.
    """

    power: float = float("nan")
    detected: bool = False
    likeness: float = float("nan")
    rival: str = ""
    told: float = float("nan")
    preferred: bool = False
    reported: bool = False


def foreseen(
    case: Case, poses: object, hidden: dict[str, float], effect: str, stage: RunStage
) -> Foreseen:
    """Judge one hidden effect in a stage whose model lacks it and nothing else that is hidden."""
    fit, diagnosis = stage.run.fit, stage.diagnosis
    own = {name: value for name, value in hidden.items() if name.split(".")[0] == effect}
    own = own if not case.unknown else hidden
    moved = displaced(case, poses, own)
    whitened = np.einsum("ijn,jn->in", fit.model.rows.whitener, moved)
    signature = whitened[:, fit.accepted].reshape(-1)
    scores, family = diagnosis.scores, diagnosis.family
    known = {c.name: k for k, c in enumerate(scores.candidates) if not c.channel}
    alike = _likeness(stage, signature, known)
    if case.unknown:
        structure = [k for k, c in enumerate(scores.candidates) if c.channel]
        best = max((power(scores, family, k, signature) for k in structure), default=0.0)
        return Foreseen(power=best, likeness=max(alike.values(), default=0.0))
    if effect not in known:
        return Foreseen()
    index = known[effect]
    findings = {finding.name: finding for finding in diagnosis.findings}
    others = {name: value for name, value in alike.items() if name != effect}
    rival = max(others, key=lambda name: others[name])
    mine, _ = observed(scores, index)
    theirs, _ = observed(scores, known[rival])
    return Foreseen(
        power=power(scores, family, index, signature),
        detected=findings[effect].p_value <= 0.05,
        likeness=others[rival],
        rival=rival,
        told=prefers(scores, index, known[rival], signature),
        preferred=mine > theirs,
        reported=any({effect, rival} <= set(group) for group in diagnosis.indistinguishable),
    )


def _likeness(stage: RunStage, signature: Vector, known: dict[str, int]) -> dict[str, float]:
    """Cosine between what is left of a signature and each candidate's columns, best trial."""
    scores = stage.diagnosis.scores
    left = scores.problem.project(signature)
    norm = max(float(signature @ left), 1e-300)
    found = {}
    for name, index in known.items():
        unit = scores.of_units(index, left[:, None])[:, :, 0]
        shares = np.einsum("tij,tj->ti", scores.weighed.weighing(index, 0).whiten, unit)
        found[name] = float(np.sqrt(np.max(np.sum(shares**2, axis=1)) / norm))
    return found


def pulls(rows: Rows, hidden: dict[str, float], last: RunStage) -> tuple[float, ...]:
    """(estimate - truth) / sigma of the hidden effects' unknowns where the right ones are found."""
    truly = {name.split(".")[0] for name in hidden}
    if set(last.effects) != truly:
        return ()
    fit = last.run.fit
    values = dict(zip(fit.model.names, zip(fit.values, fit.sigmas, strict=True), strict=True))
    unknowns = [u for group in fit.model.unknowns for u in group if not u.nonlinear]
    return tuple(
        (values[u.name][0] - hidden.get(u.name, 0.0)) / values[u.name][1]
        for u in unknowns
        if u.sigma is None and not u.name.startswith(OTHERWISE_DEFINED)
    )
