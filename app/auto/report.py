"""The answer of an automatic calibration, from its journal."""

from pathlib import Path
from typing import Any

from app.auto.autopilot import Autopilot
from app.auto.decision import Decision
from app.auto.known import HOPELESS
from app.jobs.automatic import AutoReport


def report_of(pilot: Autopilot, last: Decision, folder: Path) -> AutoReport:
    """Read back what was decided and what came of it."""
    journal = pilot.journal
    done = {line["number"]: line for line in journal.of("done")}
    found = journal.of("found")
    latest: dict[str, Any] = found[-1] if found else {}
    seen = [line for line in done.values() if "verified_um" in line]
    written = [line for line in done.values() if "left_out" in line]
    said = {
        "format": AutoReport.FORMAT,
        "folder": str(folder),
        "target_um": pilot.limits.target_um,
        "reached": last.reached,
        "why": last.why,
        "decisions": [
            {
                **{key: line[key] for key in ("number", "kind", "why", "count", "expected")},
                "pair": line["pair"] or (),
                "minutes": line.get("minutes", 0.0),
                "came": done.get(line["number"], {}).get("says", ""),
            }
            for line in journal.of("decided")
        ],
        "runs": [line["run"] for line in done.values() if "run" in line],
        "model": latest.get("model"),
        "effects": latest.get("effects", ()),
        "in_question": {
            " or ".join(line["pair"]): line[HOPELESS]
            for line in done.values()
            if HOPELESS in line and "run" not in line
        },
        "not_asked": latest.get("not_asked", {}),
        "not_written": written[-1]["left_out"] if written else {},
        "poses": sum(int(line.get("poses", 0)) for line in done.values()),
        "minutes": sum(float(line.get("minutes", 0.0)) for line in done.values()),
        "predicted_um": latest.get("predicted_um"),
        "verified_um": seen[-1]["verified_um"] if seen else None,
        "at_most_um": seen[-1]["at_most_um"] if seen else None,
    }
    return AutoReport.of(said)
