"""Right first at size 1 where the plan that is made for discovery has the power.

    python -m bench best_plan [--machine hexapod ptm] [--runs 3] [--out FILE]

29 poses of ``poses --for discovery``; on them every effect that the mock can hide is hidden at
size 1, alone, in so many runs, and the runs are discovered as in the blind trial. A run counts
where the power, which is that of its own truth in its own readings, is 0.9 or more. A line of FILE
is a run; the same command goes on.
"""

import argparse
import json
import os
import zlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from bench._blind_cases import Case, drawn_on
from bench.blind import attempt

ENOUGH = 0.9


def tried(machine: str, effect: str, number: int) -> dict[str, Any]:
    """One run: its power, what was named first, what it is said to be like."""
    seed = 7_000_000 + 3 * (zlib.crc32(f"{machine} {effect} {number}".encode()) % 300_000)
    case = Case(seed + number % 3, (effect,), (1.0,), "discovery 29", machine=machine)
    found = attempt(case)
    groups = [group for group in found.groups if found.first in group]
    return {
        "machine": machine,
        "effect": effect,
        "number": number,
        "power": found.foreseen[0].power if found.foreseen else float("nan"),
        "first": found.first,
        "alike": sorted({name for group in groups for name in group}),
        "failure": found.failure,
    }


def right(line: Mapping[str, Any]) -> bool:
    """Whether the effect is named first, or in one group with what is."""
    return line["effect"] == line["first"] or line["effect"] in line["alike"]


def table(lines: Sequence[Mapping[str, Any]], machine: str) -> list[str]:
    """Every effect of a machine, and the sum of those with enough power."""
    text = ["| effect | power | right first |", "|---|---|---|"]
    own = [line for line in lines if line["machine"] == machine]
    for effect in dict.fromkeys(line["effect"] for line in own):
        runs = [line for line in own if line["effect"] == effect]
        powers = ", ".join(f"{line['power']:.2f}" for line in runs)
        others = {str(line["first"]) for line in runs if not right(line)} - {"None"}
        instead = f" ({', '.join(sorted(others))})" if others else ""
        text.append(f"| {effect} | {powers} | {sum(map(right, runs))} of {len(runs)}{instead} |")
    enough = [line for line in own if line["power"] >= ENOUGH]
    text.append(f"| power {ENOUGH:g} or more | | {sum(map(right, enough))} of {len(enough)} |")
    return text


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--machine", nargs="+", default=["hexapod", "ptm"])
    parser.add_argument("--runs", type=int, default=3)
    parser.add_argument("--out", type=Path)
    options = parser.parse_args()
    lines: list[dict[str, Any]] = []
    if options.out is not None and options.out.exists():
        lines = [json.loads(one) for one in options.out.read_text(encoding="utf-8").splitlines()]
    done = {(line["machine"], line["effect"], line["number"]) for line in lines}
    for number in range(options.runs):
        for machine in options.machine:
            for effect in drawn_on(machine, unknown=False):
                if (machine, effect, number) in done:
                    continue
                lines.append(tried(machine, effect, number))
                if options.out is not None:
                    with options.out.open("a", encoding="utf-8") as file:
                        file.write(json.dumps(lines[-1]) + "\n")
    for machine in options.machine:
        print(machine, *table(lines, machine), sep="\n")


if __name__ == "__main__":
    main()
