"""Decisions in words, and the words with which a person answers them."""

import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from app.auto.policy import MOST, Decision

GO, SKIP, STOP = "go on", "skip", "stop"
COUNT = f"or how many, up to {MOST}: 20 poses"


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
    if decision.kind == "measure" and "predicted_um" in expected:
        return f"{expected['predicted_um']:.1f} um then"
    if "rms_um" in expected:
        return f"{expected['rms_um']:.1f} um are expected"
    return ""


def number_of_poses(said: str) -> int | None:
    """How many poses ``20 poses`` are, if that is said and one set can have so many."""
    number = re.fullmatch(r"(\d{1,3}) poses?", said.strip())
    return int(number[1]) if number is not None and 1 <= int(number[1]) <= MOST else None


def counted(decision: Decision, said: str) -> Decision | None:
    """The same measurement with another number of poses, if that is said."""
    count = number_of_poses(said)
    if count is None or decision.kind != "measure":
        return None
    why = f"{decision.why}; the operator chose how many"
    return replace(decision, count=count, why=why, expected={})


def decision_of(line: Mapping[str, Any]) -> Decision:
    """Read a decision from its line of the journal."""
    pair = line["pair"]
    return Decision(
        line["kind"], line["why"], int(line["count"]), tuple(pair) if pair else None,
        line["expected"], line["reached"], line.get("ground", ""),
    )  # fmt: skip


def found_words(found: Mapping[str, Any]) -> str:
    """What a discovery over all runs has found, in a line."""
    effects = ", ".join(found["effects"]) or "no effect"
    doubts = "".join(f"; {a} or {b}?" for a, b in found["ambiguous"])
    unknown = "; something unknown is left" if found["unexplained"] else ""
    return f"found: {effects}{doubts}{unknown}; {found['predicted_um']:.1f} um predicted"
