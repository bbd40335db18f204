"""Decisions in words, and the words with which a person answers them."""

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from app.auto.decision import Decision
from app.auto.policy import LONGEST_MIN, MOST
from app.jobs.automatic import AutoReport

GO, SKIP, STOP = "go on", "skip", "stop"
COUNT = f"or how many, up to {MOST}: 20 poses"
HOW_LONG = f"or how long, up to {LONGEST_MIN:.0f}: 20 min"


def in_words(decision: Decision) -> str:
    """What is done, why, and what is expected of it."""
    gain = gained(decision)
    return f"{decision.words()}: {decision.why}{f' ({gain})' if gain else ''}"


def gained(decision: Decision) -> str:
    """What is expected of a decision; empty where nothing can be said."""
    expected = decision.expected
    if "right_then" in expected:
        now, then = expected["right_now"], expected["right_then"]
        return f"the right answer with a probability of {now:.2f} now, {then:.2f} then"
    if "creeps_um" in expected:
        now, then = expected["creeps_um"], expected["creeps_um_then"]
        return f"the platform is about {now:.0f} um from where it will be, {then:.1f} um then"
    if decision.kind == "measure" and "predicted_um" in expected:
        return f"{expected['predicted_um']:.1f} um then"
    if "at_most_um" in expected:
        return f"{expected['at_most_um']:.1f} um then at most"
    if "rms_um" in expected:
        return f"{expected['rms_um']:.1f} um are expected"
    return ""


def typed_of(decision: Decision) -> str:
    """What may be answered in other words, where a number of poses or minutes is proposed."""
    return {"measure": COUNT, "warm-up": HOW_LONG}.get(decision.kind, "")


def understood(typed: str, said: str) -> int | None:
    """The number that is said, if it is one of what ``typed`` asks and not too large."""
    word, most = ("min", LONGEST_MIN) if typed == HOW_LONG else ("poses?", MOST)
    number = re.fullmatch(rf"(\d{{1,3}}) {word}", said.strip()) if typed else None
    return int(number[1]) if number is not None and 1 <= int(number[1]) <= most else None


def counted(decision: Decision, said: str) -> Decision | None:
    """The same with another number of poses, or of minutes, if that is said."""
    number = understood(typed_of(decision), said)
    if number is None:
        return None
    if decision.kind == "warm-up":
        why = f"{decision.why}; the operator chose how long"
        return replace(decision, minutes=float(number), why=why, expected={})
    why = f"{decision.why}; the operator chose how many"
    return replace(decision, count=number, why=why, expected={})


def decision_of(line: Mapping[str, Any]) -> Decision:
    """Read a decision from its line of the journal."""
    pair = line["pair"]
    return Decision(
        line["kind"], line["why"], int(line["count"]), tuple(pair) if pair else None,
        line["expected"], line["reached"], line.get("ground", ""),
        float(line.get("minutes", 0.0)),
    )  # fmt: skip


def found_words(found: Mapping[str, Any]) -> str:
    """What a discovery over all runs has found, in a line."""
    effects = ", ".join(found["effects"]) or "no effect"
    doubts = "".join(f"; {a} or {b}?" for a, b in found["ambiguous"])
    unknown = "; something unknown is left" if found["unexplained"] else ""
    return f"found: {effects}{doubts}{unknown}; {found['predicted_um']:.1f} um predicted"


def open_words(report: AutoReport) -> list[str]:
    """What an automatic calibration leaves open, a line for each kind of it and each reason."""
    lines = [f"in question: {pair}: {why}" for pair, why in report.in_question.items()]
    for what, effects in (("asked", report.not_asked), ("written", report.not_written)):
        for why in dict.fromkeys(effects.values()):
            names = ", ".join(name for name, own in effects.items() if own == why)
            lines.append(f"not {what}: {names} ({why})")
    return lines
