"""Effects that are called for weakly, with a value that physics forbids: chance, and said so.

A false alarm falls on either side of nothing; an effect that can only be on one side shows on the
other one as often. A clear call for such a value is a mistake in the record
(:mod:`calib.look.judged`); a weak one is most likely chance, and is no discovery.
"""

from collections.abc import Sequence
from typing import Any

from calib.discover.diagnosis import RunDiagnosis
from calib.evidence.forward import weakly
from calib.look.judged import forbidden


def forbidden_value(found: RunDiagnosis, name: str) -> str:
    """The value, in words, that an effect would have and that physics forbids; empty if none."""
    finding = next(one for one in found.diagnosis.findings if one.name == name)
    return forbidden(found.columns_of(name).effect, found.outlook(finding).estimates)


def impossible_entry(found: RunDiagnosis, name: str) -> dict[str, Any]:
    """An effect refused for its sign: p-value, value, and what else may make such a sign."""
    finding = next(one for one in found.diagnosis.findings if one.name == name)
    return {
        "effect": name,
        "p_value": finding.p_value,
        "value": forbidden_value(found, name),
        "otherwise": found.columns_of(name).effect.wrong_sign,
    }


def forbidden_best(found: RunDiagnosis) -> tuple[str, ...]:
    """The effect that would be added, if it is called for weakly and its sign cannot be."""
    best = found.diagnosis.best
    if best is None or not weakly(found.diagnosis, best.name):
        return ()
    return (best.name,) if forbidden_value(found, best.name) else ()


def chance_words(found: RunDiagnosis, impossible: Sequence[str]) -> str:
    """What is said of an effect that is called for weakly, with a value that it cannot have."""
    one = impossible_entry(found, impossible[0])
    return (
        f"Nothing is clearly missing. {one['effect']} is called for weakly (p = "
        f"{one['p_value']:.1g}), but its value cannot be ({one['value']}): most likely chance, "
        f"which does so in one run of twenty, else a sign mistake: {one['otherwise']}."
    )
