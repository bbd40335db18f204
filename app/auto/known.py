"""What is known by now, read from the journal of decisions."""

import math
from dataclasses import replace
from typing import Any

from app.auto.decision import FASTEST, SLOWEST, Known
from app.auto.findings import Findings
from app.auto.journal import Decisions

HOPELESS, REFUSED, VETOED, WAITED = "hopeless", "refused", "vetoed", "waited"
"""Keys of what came of a decision: a pair that stays in question, a gate's no, a person's no,
time in which nothing was measured."""


def runs_of(journal: Decisions) -> tuple[str, ...]:
    """Folders of all runs that were measured for the fit, in order."""
    return tuple(line["run"] for line in journal.of("done") if "run" in line)


def known_by(journal: Decisions) -> Known:
    """Everything that the next decision rests on."""
    done = journal.of("done")
    known = Known(
        poses=sum(int(line.get("poses", 0)) for line in done),
        minutes=_minutes(done),
        waited=_minutes([line for line in done if WAITED in line]),
        hopeless={tuple(line["pair"]): line[HOPELESS] for line in done if HOPELESS in line},
        declined=_declined(done),
        ended=_ended(done),
    )
    return _with_findings(known, journal, done) if runs_of(journal) else known


def _with_findings(known: Known, journal: Decisions, done: list[dict[str, Any]]) -> Known:
    found = Findings.from_json(journal.of("found")[-1])
    written = [k for k, line in enumerate(done) if "left_out" in line]
    since = done[written[-1] :] if written else []
    seen = [line for line in since if "verified_um" in line]
    unknown = [line for line in journal.of("found") if line["unexplained"]]
    return replace(
        known,
        predicted_um=found.predicted_um,
        falls=_falls(journal, done),
        ambiguous=tuple((a, b) for a, b in found.ambiguous),
        unexplained=found.unexplained,
        rounds_unknown=max(0, len(unknown) - 1) if found.unexplained else 0,
        verified_um=seen[-1]["verified_um"] if seen else None,
        at_most_um=seen[-1]["at_most_um"] if seen else None,
        creep=None if found.creep is None else found.creep.after(_minutes(_since(journal))),
        warmed=any(WAITED in line for line in _since(journal)),
        applied=bool(written) and done[written[-1]]["model"] == found.model,
        corrections=len(written),
    )


def _minutes(done: list[dict[str, Any]]) -> float:
    return sum(float(line.get("minutes", 0.0)) for line in done)


def _since(journal: Decisions) -> list[dict[str, Any]]:
    """What was done since the runs were asked the last time."""
    last = max(k for k, line in enumerate(journal.lines) if line["event"] == "found")
    return [line for line in journal.lines[last:] if line["event"] == "done"]


def _falls(journal: Decisions, done: list[dict[str, Any]]) -> float | None:
    """By which power of the poses the prediction fell when the last set with the same effects came.

    None where no such set has come. Where one more unknown is all but free, as of what goes with
    time in a short run, it falls faster than the root; never slower, as readings are independent.
    """
    poses = {line["run"]: int(line["poses"]) for line in done if "run" in line}
    seen = journal.of("found")[-2:]
    if len(seen) < 2 or set(seen[0]["effects"]) != set(seen[1]["effects"]):
        return None
    few, many = (sum(poses[run] for run in line["runs"]) for line in seen)
    before, now = (float(line["predicted_um"]) for line in seen)
    if many <= few or not 0.0 < now < before < math.inf:
        return None
    return min(max(math.log(before / now) / math.log(many / few), SLOWEST), FASTEST)


def _declined(done: list[dict[str, Any]]) -> tuple[str, ...]:
    """Grounds to which the person said no since the machine was measured the last time."""
    grounds: list[str] = []
    for line in reversed(done):
        if "run" in line or "verified_um" in line:
            break
        if line.get(VETOED) and line.get("ground"):
            grounds.append(line["ground"])
    return tuple(reversed(grounds))


def _ended(done: list[dict[str, Any]]) -> str:
    """Why it is over: what a gate has refused is not asked again with the same readings."""
    last = done[-1] if done else {}
    if REFUSED in last:
        return str(last[REFUSED])
    # Journals without grounds: a no to anything but a pair was the end.
    old = last.get(VETOED) and HOPELESS not in last and "ground" not in last
    return "the operator said no" if old else ""
