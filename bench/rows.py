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
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import pkmcal

SEEDS = (3, 4, 5)
LEGS = [f"leg{k}" for k in range(1, 7)]
BEGIN, END = "<!-- bench rows: begin -->", "<!-- bench rows: end -->"
Table = list[dict[str, str]]
Effects = Mapping[str, float]


@dataclass(frozen=True)
class Row:
    """A gap: how its runs are simulated, what is to be named, and what more is to hold.

    ``spoil`` changes the rows of ``points.csv``; ``holds`` says what of an answer is wrong, empty
    if nothing is; ``beside``: another run of the same machine without the effect is given, too.
    """

    name: str
    was: str
    machine: str = "hexapod"
    effects: Effects = field(default_factory=dict)
    options: Mapping[str, Any] = field(default_factory=dict)
    named: tuple[str, ...] = ()
    spoil: Callable[[Table, np.random.Generator], Table] | None = None
    holds: Callable[[dict[str, Any]], str] = lambda answer: ""
    beside: bool = False

    @property
    def command(self) -> str:
        """What makes a run of it."""
        effects = "".join(f" --effect {name}={value:g}" for name, value in self.effects.items())
        options = "".join(f" --{name} {value:g}" for name, value in self._plain())
        return f"simulate {self.machine}{options}{effects}"

    def _plain(self) -> list[tuple[str, float]]:
        flat = []
        for name, value in self.options.items():
            several = value if isinstance(value, tuple) else (value,)
            flat += [(name, float(one)) for one in several]
        return flat


def exchanged(rows: Table, rng: np.random.Generator) -> Table:
    """Labels 4 and 5 changed for one another, throughout."""
    other = {"4": "5", "5": "4"}
    return [row | {"nest": other.get(row["nest"], row["nest"])} for row in rows]


def loose(rows: Table, rng: np.random.Generator) -> Table:
    """The reference nest b3 gives way by 30 um an axis, another way each time it is read."""
    return [
        row | {axis: f"{float(row[axis]) + 0.03 * rng.standard_normal():.5f}" for axis in "xyz"}
        if row["nest"] == "b3"
        else row
        for row in rows
    ]


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


ROWS = (
    Row(
        "tracker encoder, once per turn",
        "tracker-offset",
        effects={"tracker-encoder.azimuth.sin": 1.5e-4},
        named=("tracker-encoder",),
        holds=told,
    ),
    Row(
        "warm-up, exp(-t/40 min)",
        "thermal-growth",
        effects={"warm-up.A": 0.06, "warm-up.tau": 2400.0},
        named=("warm-up",),
    ),
    Row(
        "one side warmer: legs 1 and 2",
        "frame-shift, or thermal-growth and tracker-offset",
        effects={"leg-warming.leg1": 0.006, "leg-warming.leg2": 0.006},
        named=("leg-warming",),
    ),
    Row(
        "index slip of one leg",
        "-",
        effects={"actuator-step.leg4": 0.03, "actuator-step.t0": 700.0},
        named=("actuator-step",),
    ),
    Row(
        "stick-slip",
        "-",
        named=("stick-slip",),
        effects={**{f"stick-slip.{leg}": 0.025 for leg in LEGS}, "stick-slip.reach": 4.0},
    ),
    Row(
        "loaded backlash",
        "-",
        options={"payload": (0.0, 12.0)},
        named=("loaded-backlash",),
        effects={f"loaded-backlash.{leg}": 1e-3 for leg in LEGS},
    ),
    Row(
        "one-sided contact",
        "-",
        named=("contact",),
        effects={"contact.leg2": 2e-3, "contact.at": 0.6, "contact.side": 1.0},
    ),
    Row(
        "warm-up of one leg",
        "-",
        named=("leg-warm-up",),
        effects={"leg-warm-up.leg5": 0.08, "leg-warm-up.tau": 900.0},
    ),
    Row("warming of one leg", "-", effects={"leg-warming.leg5": 0.008}, named=("leg-warming",)),
    Row(
        "compliance of one leg",
        "-",
        options={"payload": (0.0, 12.0)},
        named=("leg-compliance",),
        effects={"leg-compliance.leg3": 1.5e-3},
    ),
    Row(
        "the tracker moved in the first of two runs",
        "wrong or nothing in 5 of 8",
        beside=True,
        effects={
            "frame-shift.x": 0.04,
            "frame-shift.rz": 1e-4,
            "frame-shift.t0": 700.0,
            "frame-shift.where": 1.0,
        },
        named=("frame-shift",),
    ),
    Row(
        "eccentric encoder of the ptm, 1.5 mrad",
        "screw-pitch, without a warning",
        machine="ptm",
        effects={"screw-cyclic.limb1.sin": 1.5e-3},
        named=("screw-cyclic",),
    ),
    Row(
        "ptm, nothing hidden",
        "redundancy raises RMS from 8.35 to 9.90 um",
        machine="ptm",
        holds=never_worse,
    ),
    Row(
        "a loose reference nest",
        "3 to 6 of 7 readings dropped, 'to their noise'",
        spoil=loose,
        holds=of_the_nest,
    ),
    Row(
        "growth with a negative sign",
        "named without a word",
        effects={"thermal-growth.a": -3e-5},
        named=("thermal-growth",),
        holds=of_the_sign,
    ),
    Row(
        "nests 4 and 5 exchanged throughout",
        "160 of 268 readings excluded, two effects named",
        effects={"backlash.leg3": 0.03},
        named=("backlash",),
        spoil=exchanged,
        holds=of_the_labels,
    ),
)  # fmt: skip


def answered(row: Row, seed: int, folder: Path) -> dict[str, Any]:
    """Simulate a row's run, spoil it, discover it."""
    run = folder / f"run{seed}"
    options = {"noise_um": 5.0, **row.options}
    pkmcal.simulate(row.machine, run, seed=seed, effects=row.effects, **options)
    if row.spoil is not None:
        points = run / "points.csv"
        with points.open(encoding="utf-8", newline="") as source:
            rows = list(csv.DictReader(source))
        spoilt = row.spoil(rows, np.random.default_rng(seed))
        with points.open("w", encoding="utf-8", newline="") as target:
            writer = csv.DictWriter(target, spoilt[0].keys(), lineterminator="\n")
            writer.writeheader()
            writer.writerows(spoilt)
    runs = [run]
    if row.beside:
        truth = json.loads((run / "truth.json").read_text(encoding="utf-8"))
        parameters = folder / f"parameters{seed}.toml"
        lines = [f'"{name}" = {value!r}' for name, value in truth["parameters"].items()]
        parameters.write_text("\n".join(["[parameters]", *lines]) + "\n", encoding="utf-8")
        second = folder / f"second{seed}"
        pkmcal.simulate(row.machine, second, seed=seed + 100, parameters=parameters, **options)
        runs.append(second)
    return dict(pkmcal.discover(runs).to_json())


def verdict(row: Row, answer: dict[str, Any]) -> str:
    """What is wrong with an answer; empty if it is right.

    Right is what was hidden, or, where the readings cannot tell, a group that holds it.
    """
    found = set(answer["effects"])
    groups = [set(group) for group in answer.get("indistinguishable", [])]
    wanted = set(row.named)
    alike = set().union(*(group for group in groups if group & wanted)) if groups else set()
    right = found <= (wanted | alike) if wanted else not found
    if wanted and not found & (wanted | alike):
        right = False
    wrong = [] if right else [", ".join(sorted(found)) or "nothing"]
    more = row.holds(answer)
    return "; ".join([*wrong, *([more] if more else [])])


def tried(row: Row) -> dict[str, Any]:
    """All seeds of a row."""
    wrongs, said, adequate = [], [], 0
    for seed in SEEDS:
        with tempfile.TemporaryDirectory() as made:
            answer = answered(row, seed, Path(made))
        wrongs.append(verdict(row, answer))
        said.append(", ".join(answer["effects"]) or "nothing")
        adequate += bool(answer["adequate"])
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
