"""How much of what is missing known effects explain, where they do not explain all of it."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from calib.discover.discovery import stage_of
from calib.evidence.findings import Diagnosis
from calib.evidence.forward import Discovery

ALIKE = 0.5
"""Likeness from which an effect is spoken of."""
NEARLY_ALL = 0.95
"""Likeness from which what was found is not questioned: what is left is little beside it."""


def excess(diagnosis: Diagnosis) -> float:
    """Chi-square of the residual beyond what noise leaves there."""
    scores = diagnosis.scores
    return float(scores.problem.residual @ scores.problem.residual) - float(scores.problem.trace)


def likeness_of(diagnosis: Diagnosis) -> dict[str, Any] | None:
    """The effect that is likest to an unknown one, and the cosine between the two; None if none.

    Nothing that is known is called for then, or structure of unknown origin explains much more.
    """
    whole = excess(diagnosis)
    best = max(diagnosis.findings, key=lambda found: found.chi2_fall - found.dof, default=None)
    if best is None or not diagnosis.unexplained.significant or whole <= 0.0:
        return None
    value = float(np.sqrt(np.clip((best.chi2_fall - best.dof) / whole, 0.0, 1.0)))
    return {"effects": [best.name], "value": value} if value >= ALIKE else None


def likeness_of_found(discovery: Discovery) -> dict[str, Any] | None:
    """The same of what a discovery has added, where it is not the whole story."""
    last = discovery.last
    added = [step.added for step in discovery.steps if step.added in last.effects]
    if not last.diagnosis.unexplained.significant:
        return None
    if not added:
        return likeness_of(last.diagnosis)
    whole, left = excess(stage_of(discovery, 0).diagnosis), excess(last.diagnosis)
    if whole <= 0.0:
        return None
    value = float(np.sqrt(np.clip(1.0 - left / whole, 0.0, 1.0)))
    return {"effects": added, "value": value}


def likeness_words(likeness: dict[str, Any] | None, depends: str, held: Sequence[str] = ()) -> str:
    """``It is like X (0.7), but not X: it depends on q3``; empty without a likeness.

    ``held`` is what the model has: nearly all of what was missing, it is what it was called.
    """
    if likeness is None:
        return ""
    names, value = " with ".join(likeness["effects"]), likeness["value"]
    if value >= NEARLY_ALL and set(likeness["effects"]) <= set(held):
        return f" Of what was missing {names} explains {100.0 * value**2:.0f} %."
    return f" It is like {names} ({likeness['value']:.1f}), but not {names}: {depends}."
