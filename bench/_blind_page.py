"""The blind trial's page: the table of wanted and measured, and what lies behind it."""

from collections import defaultdict
from collections.abc import Sequence
from itertools import permutations
from typing import Any

import numpy as np

INTRODUCTION = """
Runs with hidden effects, made by the mock's own physics (`mocks.simulate`, which knows neither
the engine nor the effects), are diagnosed and discovered without sight of the truth, then
scored.

- **Size** of an effect: RMS over the readings of the displacement that it causes before any
  refit, in units of sqrt(3) sigma of a reading (5 um an axis). Effects are drawn in equal
  shares; one leg or all of them act. True parameters come from the machine's tolerances. Pose
  sets: 29 designed for pose accuracy (not for any effect), 29, 60 or 100 random ones. The
  structure warms by 6 K.
- **Right** is an effect that was hidden, or one that is reported as indistinguishable from it.
  *First* is what the first diagnosis names; *both named* is what discovery has added and kept.
- **Power** is predicted by the program, from the run and the hidden size, in the model that has
  the other hidden effects: the probability that the effect is significant with everything
  looked at paid for; *among fewer*: where only the 18 effects of an earlier catalogue are looked
  for. Where it is low these readings hardly hold the effect: geometry, within its tolerances,
  takes it. The rows "where the power is 0.9 or more" tell what is lost by the method from what
  the readings never held.
- **Follow-up**: where the first run has not decided, ten poses designed by `pkmcal design`,
  measured on another day and in another frame, diagnosed together with the first run.
- **Unknown effects** are listed where some structure has a predicted power of 0.9 or more and
  no known effect is alike by a cosine above 0.7 after projection.
"""


Groups = Sequence[Sequence[str]]


def right(name: str | None, groups: Groups, wanted: Sequence[str]) -> bool:
    """Whether a name is one of those wanted, or stands in a reported group with one of them."""
    if name is None:
        return False
    if name in wanted:
        return True
    return any(name in group and set(group) & set(wanted) for group in groups)


def first_right(outcome: Any) -> bool:
    """Whether the first diagnosis names a hidden effect, or one that it cannot tell from it."""
    return right(outcome.first, outcome.groups, outcome.case.effects)


def both_named(outcome: Any, *, hints: bool = False) -> bool:
    """Whether every hidden effect, or one that cannot be told from it, was found; each its own.

    With ``hints`` those count too that were called for, but too weakly to be added.
    """
    told = (*outcome.found, *(outcome.hinted if hints else ()))
    return any(
        all(
            right(name, outcome.groups, (effect,))
            for name, effect in zip(found, outcome.case.effects, strict=True)
        )
        for found in permutations(told, len(outcome.case.effects))
    )


def _share(values: Sequence[bool]) -> str:
    if not values:
        return "-"
    p = float(np.mean(values))
    error = np.sqrt(max(p * (1 - p), 1e-12) / len(values))
    return f"{100 * p:.1f} +- {100 * error:.1f} % of {len(values)}"


def _told_apart(outcomes: Sequence[Any]) -> tuple[str, str]:
    """Pairs that were to be told apart with less than 0.8: reported as such; predicted, observed.

    The pair is the hidden effect and the candidate to which its signature is likest. Only runs
    count in which one of the two was named: a pair of which nothing is seen is no question.
    """
    asked = [
        (o, f)
        for o in outcomes
        for f in o.foreseen[:1]
        if f.rival and o.first in (o.case.effects[0], f.rival)
    ]
    low = [f.reported for _, f in asked if f.told < 0.8]
    gap = [f.told - f.preferred for _, f in asked]
    told = f"{np.mean(gap):+.3f} over {len(gap)}" if gap else "-"
    return _share(low), told


def page(outcomes: Sequence[Any], machine: str) -> str:
    """Markdown text of a machine's part of the page."""
    null = [o for o in outcomes if not o.case.effects]
    single = [o for o in outcomes if o.case.kind == "single"]
    size1 = [o for o in single if o.case.sizes[0] == 1.0]
    designed = [o for o in size1 if o.case.poses == "designed 29"]
    named = [o for o in single if o.first is not None]
    declared = [o for o in single if not o.adequate]
    pairs = [o for o in outcomes if len(o.case.effects) == 2]
    visible = [o for o in pairs if o.foreseen and min(f.power for f in o.foreseen) >= 0.9]
    unknown = [o for o in outcomes if o.case.unknown]
    listed = [
        o
        for o in unknown
        if o.foreseen and o.foreseen[0].power >= 0.9 and o.foreseen[0].likeness <= 0.7
    ]
    inside = [abs(pull) < 1.0 for o in outcomes for pull in o.pulls]
    correct = [o for o in outcomes if o.case.effects and set(o.found) == set(o.case.effects)]
    powered = [o.foreseen[0] for o in single if o.foreseen and np.isfinite(o.foreseen[0].power)]
    gap = float(np.mean([f.power - f.detected for f in powered])) if powered else 0.0
    reported, told = _told_apart(single)
    each = float(np.mean([o.seconds for o in outcomes if o.case.effects] or [0.0]))
    quiet = float(np.mean([o.seconds for o in null] or [0.0]))
    rows = [
        ("false alarms with nothing hidden", "4..6 %", _share([not o.adequate for o in null])),
        ("right effect first, size 1, 29 designed poses", ">= 75 %",
         _share([first_right(o) for o in designed])),
        ("the same after one designed follow-up of 10 poses", ">= 85 %",
         _share([_right_after(o) for o in designed])),
        ("the same without follow-up, all pose sets", "",
         _share([first_right(o) for o in size1])),
        ("the same where the power is 0.9 or more", "",
         _share([first_right(o) for o in size1
                 if o.foreseen and o.foreseen[0].power >= 0.9])),
        ("right effect first among runs in which something was declared", ">= 95 %",
         _share([first_right(o) for o in declared])),
        ("right effect first among runs in which one was named", "",
         _share([first_right(o) for o in named])),
        ("the same, itself first: no group counted", "",
         _share([o.first in o.case.effects for o in declared])),
        ("runs with one effect in which it is said to be like another", "",
         _share([any(o.first in group for group in o.groups) for o in named])),
        ("two effects at size 2, both named", ">= 80 %",
         _share([both_named(o) for o in pairs])),
        ("both named, or the second at least hinted at (p from 0.001 to 0.05)", "",
         _share([both_named(o, hints=True) for o in pairs])),
        ("two effects, both named, where the power is 0.9 or more for both", "",
         _share([both_named(o) for o in visible])),
        ("unknown effects declared unknown (listed ones)", ">= 90 %",
         _share([o.unexplained for o in listed])),
        ("unknown effects declared unknown (all)", "", _share([o.unexplained for o in unknown])),
        ("68 % intervals hold", "63..73 %", _share(inside)),
        ("predicted minus observed power", "within 0.05", f"{gap:+.3f} over {len(powered)}"),
        ("hold-out over floor after the right effects", "<= 1.1",
         f"{np.mean([o.holdout_over_floor for o in correct]):.3f}" if correct else "-"),
        ("hold-out higher than before the last accepted step", "never",
         str(sum(o.holdout_rose for o in outcomes))),
        ("pairs told apart with probability < 0.8, reported as such", "all", reported),
        ("predicted minus observed probability to tell a pair apart", "", told),
        ("good readings excluded", "", f"{sum(o.bad for o in outcomes)} in {len(outcomes)} runs"),
        ("1,000 runs on two cores", "< 5 min",
         f"{500 * each:.0f} s with effects hidden, {500 * quiet:.0f} s with none "
         "(half of their CPU time)"),
    ]  # fmt: skip
    text = [f"## {machine}", "", "| | wanted | measured |", "|---|---|---|"]  # fmt: skip
    text += [f"| {what} | {wanted} | {measured} |" for what, wanted, measured in rows]
    text += ["", "### By effect (single, named first; what was named instead)", "",
             "| effect | size | runs | right first | named instead | nothing named | power "
             "| among fewer |",
             "|---|---|---|---|---|---|---|---|"]  # fmt: skip
    table: dict[tuple[str, float], list[Any]] = defaultdict(list)
    for o in [*single, *unknown]:
        table[o.case.effects[0], o.case.sizes[0]].append(o)
    for (effect, size), members in sorted(table.items()):
        hits = sum(first_right(o) for o in members)
        none = sum(o.first is None for o in members)
        wrong = [o.first for o in members if o.first and not first_right(o)]
        powers = [f.power for o in members for f in o.foreseen[:1]]
        fewer = [o.among_fewer for o in members if np.isfinite(o.among_fewer)]
        text.append(
            f"| {effect} | {size:g} | {len(members)} | {hits} | "
            f"{', '.join(f'{n} {wrong.count(n)}' for n in dict.fromkeys(wrong))} | {none} | "
            f"{np.nanmean(powers) if powers else float('nan'):.2f} | "
            f"{f'{np.mean(fewer):.2f}' if fewer else ''} |"
        )
    text += _pairs_missed(pairs)
    text += ["", "Unknown effects that are listed (predicted power >= 0.9, likeness <= 0.7):", ""]
    text += [
        f"- {o.case.effects[0]}, {o.case.poses}, seed {o.case.seed}: "
        f"{'declared' if o.unexplained else 'missed'}"
        for o in listed
    ]
    failures = [o for o in outcomes if o.failure]
    text += ["", f"Runs that ended in an error: {len(failures)}", ""]
    text += [f"- {o.case.seed}, {', '.join(o.case.effects)}: {o.failure}" for o in failures]
    alarms = [o.first or "structure" for o in null if not o.adequate]
    text += ["False alarms: " + (", ".join(
        f"{name} {alarms.count(name)}" for name in sorted(set(alarms))) or "none")]  # fmt: skip
    return "\n".join(text) + "\n"


def _right_after(outcome: Any) -> bool:
    """The same after the follow-up, by the groups of both runs together."""
    return outcome.after is not None and right(*outcome.after, outcome.case.effects)


def _pairs_missed(pairs: Sequence[Any]) -> list[str]:
    """Which of two hidden effects was not named, and with what power it was to be seen."""
    text = ["", "Of two effects not named (power in the model that has the other):", ""]
    missed: dict[str, list[float]] = defaultdict(list)
    for o in pairs:
        for effect, seen in zip(o.case.effects, o.foreseen, strict=False):
            if not any(right(name, o.groups, (effect,)) for name in o.found):
                missed[effect].append(seen.power)
    for effect, powers in sorted(missed.items()):
        text.append(f"- {effect}: " + ", ".join(f"{power:.2f}" for power in sorted(powers)))
    return text
