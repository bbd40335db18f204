"""Runs that were once answered wrongly, each by a public command, and today's answers as a page.

    python -m bench rows [--only NAME ...] [--out FILE] [--page docs/discovery-statistics.md]

Every row simulates runs by the mock's own physics (some are spoilt as people spoil them), discovers
them, and holds the answer against what was hidden. A row is a line of FILE, of which the same
command goes on.
"""

import argparse
import csv
import json
import os
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import pkmcal
from bench._rows_cases import ROWS, Row
from calib.errors import BadInput

SEEDS = (3, 4, 5)
BEGIN, END = "<!-- bench rows: begin -->", "<!-- bench rows: end -->"


def answered(row: Row, seed: int, folder: Path) -> dict[str, Any]:
    """Simulate a row's run, spoil it, discover it."""
    run = folder / f"run{seed}"
    options = {"noise_um": 5.0, **row.options}
    pkmcal.simulate(row.machine, run, seed=seed, effects=row.effects, **options)
    points = run / "points.csv"
    with points.open(encoding="utf-8", newline="") as source:
        rows = list(csv.DictReader(source))
    spoilt = row.spoil(rows, np.random.default_rng(seed))
    with points.open("w", encoding="utf-8", newline="") as target:
        writer = csv.DictWriter(target, spoilt[0].keys(), lineterminator="\n")
        writer.writeheader()
        writer.writerows(spoilt)
    runs = [run]
    if row.beside or row.without_load:
        runs.append(second(row, run, seed, options))
    try:
        return dict(pkmcal.discover(runs).to_json())
    except BadInput as error:
        if not row.refused:
            raise
        return {"refused": str(error)}


def second(row: Row, first: Path, seed: int, options: Mapping[str, Any]) -> Path:
    """Another run of the machine of ``first``."""
    truth = json.loads((first / "truth.json").read_text(encoding="utf-8"))
    parameters = first.with_name(f"parameters{seed}.toml")
    lines = [f'"{name}" = {value!r}' for name, value in truth["parameters"].items()]
    parameters.write_text("\n".join(["[parameters]", *lines]) + "\n", encoding="utf-8")
    run = first.with_name(f"second{seed}")
    effects = row.effects if row.without_load else {}
    pkmcal.simulate(
        row.machine, run, seed=seed + 100, parameters=parameters, effects=effects, **options
    )
    if row.without_load:
        header = run / "run.toml"
        kept = header.read_text(encoding="utf-8").partition("[load]")[0]
        header.write_text(kept, encoding="utf-8")
    return run


def verdict(row: Row, answer: dict[str, Any]) -> str:
    """What is wrong with an answer; empty if it is right.

    Right is what was hidden, or, where the readings cannot tell, a group that holds it.
    """
    if row.refused:
        said = answer.get("refused", "not refused")
        return "" if row.refused in said else said
    found = set(answer["effects"])
    groups = [set(group) for group in answer.get("indistinguishable", [])]
    wanted = set(row.named)
    alike = set().union(*(group for group in groups if group & wanted)) if groups else set()
    right = found <= (wanted | alike) if wanted else not found
    if wanted and not found & (wanted | alike):
        right = False
    wrong = [] if right or row.anything else [", ".join(sorted(found)) or "nothing"]
    more = row.holds(answer)
    return "; ".join([*wrong, *([more] if more else [])])


def tried(row: Row) -> dict[str, Any]:
    """All seeds of a row."""
    wrongs, said, adequate = [], [], 0
    for seed in SEEDS:
        with tempfile.TemporaryDirectory() as made:
            answer = answered(row, seed, Path(made))
        wrongs.append(verdict(row, answer))
        said.append("refused" if row.refused else ", ".join(answer["effects"]) or "nothing")
        adequate += bool(answer.get("adequate", False))
    return {"name": row.name, "said": said, "wrong": wrongs, "adequate": adequate}


def table(lines: Sequence[Mapping[str, Any]]) -> list[str]:
    """The page's table."""
    text = [
        "| what is in the run | once | now named, seeds 3, 4, 5 | right | called adequate |",
        "|---|---|---|---|---|",
    ]
    there = {line["name"]: line for line in lines}
    for row in ROWS:
        if row.name not in there:
            continue
        line = there[row.name]
        said = line["said"]
        named = said[0] if len(set(said)) == 1 else "; ".join(said)
        right = sum(not wrong for wrong in line["wrong"])
        wrong = "".join(f" ({one})" for one in dict.fromkeys(line["wrong"]) if one)
        text.append(
            f"| {row.name}: `{row.command}` | {row.was} | {named} | {right} of {len(said)}{wrong} "
            f"| {line['adequate']} of {len(said)} |"
        )
    return text


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", nargs="+", default=[row.name for row in ROWS])
    parser.add_argument("--out", type=Path)
    parser.add_argument("--page", type=Path)
    options = parser.parse_args()
    lines: list[dict[str, Any]] = []
    if options.out is not None and options.out.exists():
        lines = [json.loads(one) for one in options.out.read_text(encoding="utf-8").splitlines()]
    for row in ROWS:
        if row.name in options.only and row.name not in {line["name"] for line in lines}:
            lines.append(tried(row))
            print(lines[-1], flush=True)
            if options.out is not None:
                with options.out.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(lines[-1]) + "\n")
    text = table(lines)
    print("\n".join(text))
    if options.page is not None:
        before, _, rest = options.page.read_text(encoding="utf-8").partition(BEGIN)
        after = rest.partition(END)[2]
        options.page.write_text("\n".join([before + BEGIN, *text, END + after]), encoding="utf-8")


if __name__ == "__main__":
    main()
