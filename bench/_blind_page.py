"""The blind trial's page: the table of wanted and measured, and what lies behind it."""

from collections import defaultdict
from collections.abc import Sequence
from typing import Any

import numpy as np


def right(outcome: Any, name: str | None, wanted: Sequence[str]) -> bool:
    """Whether a name is one of those wanted, or stands in a reported group with one of them."""
    if name is None:
        return False
    if name in wanted:
        return True
    return any(name in group and set(group) & set(wanted) for group in outcome.groups)


def both_named(outcome: Any) -> bool:
    """Whether every hidden effect (or one that cannot be told from it) was found."""
    return all(
        any(right(outcome, name, (effect,)) for name in outcome.found)
        for effect in outcome.case.effects
    )


def _share(values: Sequence[bool]) -> str:
    if not values:
        return "-"
    p = float(np.mean(values))
    error = np.sqrt(max(p * (1 - p), 1e-12) / len(values))
    return f"{100 * p:.1f} +- {100 * error:.1f} % of {len(values)}"


def page(outcomes: Sequence[Any], machine: str, seconds: float) -> str:
    """Markdown text of a machine's part of the page."""
    null = [o for o in outcomes if not o.case.effects]
    single = [o for o in outcomes if len(o.case.effects) == 1 and not o.case.unknown]
    size1 = [o for o in single if o.case.sizes[0] == 1.0]
    designed = [o for o in size1 if o.case.poses == "designed 29"]
    named = [o for o in single if o.first is not None]
    declared = [o for o in single if not o.adequate]
    pairs = [o for o in outcomes if len(o.case.effects) == 2]
    unknown = [o for o in outcomes if o.case.unknown]
    listed = [o for o in unknown if o.predicted_power >= 0.9 and o.likeness <= 0.7]
    pulls = [abs(pull) < 1.0 for o in outcomes for pull in o.pulls]
    correct = [o for o in outcomes if o.case.effects and set(o.found) == set(o.case.effects)]
    powered = [o for o in single if np.isfinite(o.predicted_power)]
    gap = float(np.mean([o.predicted_power - o.detected for o in powered])) if powered else 0.0
    each = float(np.mean([o.seconds for o in outcomes]))
    rows = [
        ("false alarms with nothing hidden", "4..6 %", _share([not o.adequate for o in null])),
        ("right effect first, size 1, 29 designed poses", ">= 75 %",
         _share([right(o, o.first, o.case.effects) for o in designed])),
        ("right effect first, size 1, all pose sets", "",
         _share([right(o, o.first, o.case.effects) for o in size1])),
        ("right effect first among runs in which one was named", ">= 95 %",
         _share([right(o, o.first, o.case.effects) for o in named])),
        ("something declared, single effects", "", _share([not o.adequate for o in declared])),
        ("two effects at size 2, both named", ">= 80 %",
         _share([both_named(o) for o in pairs])),
        ("unknown effects declared unknown (listed ones)", ">= 90 %",
         _share([o.unexplained for o in listed])),
        ("unknown effects declared unknown (all)", "", _share([o.unexplained for o in unknown])),
        ("68 % intervals hold", "63..73 %", _share(pulls)),
        ("predicted minus observed power", "within 0.05", f"{gap:+.3f} over {len(powered)}"),
        ("hold-out over floor after the right effects", "<= 1.1",
         f"{np.mean([o.holdout_over_floor for o in correct]):.3f}" if correct else "-"),
        ("hold-out rose at an accepted step", "never",
         str(sum(o.holdout_rose for o in outcomes))),
        ("good readings excluded", "", f"{sum(o.bad for o in outcomes)} in {len(outcomes)} runs"),
        ("time", "1,000 runs < 5 min",
         f"{seconds:.0f} s for {len(outcomes)} runs; discovery {each:.2f} s each"),
    ]  # fmt: skip
    text = [f"## {machine}", "", "| | wanted | measured |", "|---|---|---|"]  # fmt: skip
    text += [f"| {what} | {wanted} | {measured} |" for what, wanted, measured in rows]
    text += ["", "### By effect (single, named first; what was named instead)", "",
             "| effect | size | runs | right first | named instead | nothing named | power |",
             "|---|---|---|---|---|---|---|"]  # fmt: skip
    table: dict[tuple[str, float], list[Any]] = defaultdict(list)
    for o in [*single, *unknown]:
        table[o.case.effects[0], o.case.sizes[0]].append(o)
    for (effect, size), members in sorted(table.items()):
        hits = sum(right(o, o.first, o.case.effects) for o in members)
        none = sum(o.first is None for o in members)
        wrong = [o.first for o in members if o.first and not right(o, o.first, o.case.effects)]
        predicted = np.nanmean([o.predicted_power for o in members])
        text.append(
            f"| {effect} | {size:g} | {len(members)} | {hits} | "
            f"{', '.join(f'{n} {wrong.count(n)}' for n in dict.fromkeys(wrong))} | {none} | "
            f"{predicted:.2f} |"
        )
    text += ["", "Unknown effects that are listed (predicted power >= 0.9, likeness <= 0.7):", ""]
    text += [
        f"- {o.case.effects[0]}, {o.case.poses}, seed {o.case.seed}: "
        f"{'declared' if o.unexplained else 'missed'}"
        for o in listed
    ]
    failures = [o for o in outcomes if o.failure]
    text += ["", f"Runs that ended in an error: {len(failures)}", ""]
    text += [f"- {o.case.seed}, {', '.join(o.case.effects)}: {o.failure}" for o in failures]
    alarms = [o for o in null if not o.adequate]
    text += ["", "False alarms: " + (", ".join(
        f"{o.case.seed} {o.first or 'structure'}" for o in alarms) or "none")]  # fmt: skip
    return "\n".join(text) + "\n"
