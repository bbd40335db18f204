"""What more is to hold of an answer than the names in it; empty words if it does."""

import json
from itertools import pairwise
from typing import Any


def never_worse(answer: dict[str, Any]) -> str:
    """A step that was accepted explains the readings no worse than the one before."""
    steps = answer["steps"]
    worse = [
        step["added"]
        for before, step in pairwise(steps)
        if step["added"] and step["rms_um"] > 1.001 * before["rms_um"]
    ]
    return f"worse with {', '.join(worse)}" if worse else ""


def told(answer: dict[str, Any]) -> str:
    """Every step has its p-value, evidence and rivals."""
    keys = {"p_value", "log_evidence", "weak", "rivals"}
    lacking = [step["added"] for step in answer["steps"][1:] if not keys <= step.keys()]
    return f"nothing said of {lacking}" if lacking else ""


def of_the_nest(answer: dict[str, Any]) -> str:
    """The loose nest is named, in the record or in the advice; the readings are not well."""
    said = json.dumps(answer["record"]) + answer["advice"]
    return "" if "b3" in said else "b3 is not named"


def of_the_sign(answer: dict[str, Any]) -> str:
    """A sign that physics forbids is said."""
    said = json.dumps(answer["record"]) + json.dumps(answer.get("impossible", []))
    return "" if "impossible" in said or answer.get("impossible") else "nothing is said of the sign"


def of_the_labels(answer: dict[str, Any]) -> str:
    """The exchange is said, and no reading left out."""
    names = [one["name"] for one in answer["record"]]
    return "" if names == ["nests-exchanged"] and not answer["bad_readings"] else f"{names}"


def sober(answer: dict[str, Any]) -> str:
    """No uncertainty is beyond what the tolerances, or the run, leave open."""
    most = {"mm": 1.0, "rad": 0.02, "s": 900.0}
    wild = [
        f"{one['name']} +- {one['sigma']:.3g}"
        for one in answer["parameters"]
        if one["sigma"] > most.get(one["unit"], float("inf"))
    ]
    return ", ".join(wild)


def of_the_period(answer: dict[str, Any]) -> str:
    """The period of what is unknown is that of the tide, to a tenth of a second."""
    found = answer["unexplained"].get("periods", {}).get("time_s", float("nan"))
    return "" if abs(found - 50.03) < 0.1 else f"period {found:.2f} s"


def of_the_scatter(answer: dict[str, Any]) -> str:
    """The nest that scatters is told as noise."""
    kinds = [(one["name"], one["of_what"]) for one in answer["noise"]["components"]]
    return "" if ("scale-of", "nest 4") in kinds else f"noise {kinds}"


def of_the_drift(answer: dict[str, Any]) -> str:
    """A drift that no effect is may be named like one, but is not called the whole story."""
    return f"{', '.join(answer['effects'])}, adequate" * bool(
        answer["adequate"] and answer["effects"]
    )
