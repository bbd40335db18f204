"""What readings can tell, in words and as data."""

from collections.abc import Sequence
from typing import Any

from app.show.text_table import text_table
from calib.analysis.benefit import Option
from calib.analysis.gauge import Gauges
from calib.analysis.identifiability import Identifiability, Relation
from calib.analysis.subsets import SubsetResult
from calib.mechanism.description import Machine

SHOWN = 14
"""Groups that are told in words; all of them are in the JSON answer."""


def report(
    machine: Machine,
    readings: str,
    poses: int,
    found: Identifiability,
    gauge: Gauges,
    subsets: Sequence[SubsetResult],
    benefits: Sequence[Option],
) -> tuple[dict[str, Any], str]:
    """The whole answer, as data and as text."""
    own = {p.name for p in machine.parameters}
    identified = [n for n, yes in zip(found.names, found.identified, strict=True) if yes]
    data = {
        "readings": readings,
        "poses": poses,
        "unknowns": len(found.names),
        "rank": found.rank,
        "weak": found.weak,
        "smallest_kept": found.smallest_kept,
        "singular_values": found.singular_values,
        "base_parameters": found.base,
        "relations": [{"name": r.name, "like": dict(r.like)} for r in found.relations],
        "exact_groups": found.exact_groups,
        "identified": [n for n in identified if n in own],
        "unidentified": found.practical_groups,
        "sigma_ratio": dict(zip(found.names, found.sigma_ratio, strict=True)),
        "gauge": {
            "exact": gauge.exact,
            "weak": gauge.weak,
            "motions": [
                {"body": m.body, "motion": m.motion, "visible": m.visible, "verdict": m.verdict}
                for m in gauge.motions
            ],
            "alike": gauge.alike,
        },
        "subsets": [vars(s) for s in subsets],
        "options": [vars(o) for o in benefits],
    }
    parts = [
        f"{machine.name}, {poses} poses; {readings}",
        _rank_words(found),
        _exact_words(found),
        _practical_words(found, own),
        _gauge_words(gauge),
        _subset_words(subsets),
        _option_words(benefits),
    ]
    return data, "\n\n".join(part for part in parts if part)


def _rank_words(found: Identifiability) -> str:
    unknowns, hidden = len(found.names), len(found.names) - found.rank
    text = f"Rank: the readings show {found.rank} independent combinations of {unknowns} unknowns."
    if hidden:
        text += (
            f" {hidden} combination{'s change' if hidden > 1 else ' changes'} no reading at all."
        )
    return (
        f"{text}\nThe weakest visible one has {found.smallest_kept:.1e} of the strongest; "
        f"{found.weak} are seen less sharply than the tolerances know them."
    )


def _exact_words(found: Identifiability) -> str:
    if not found.exact_groups:
        return ""
    relations = {r.name: r for r in found.relations}
    lines = []
    for group in found.exact_groups[:SHOWN]:
        dependent = [relations[name] for name in group if name in relations]
        if len(group) == 1 and not dependent[0].like:
            lines.append(f"  {group[0]}: no reading depends on it")
            continue
        seen = len(group) - len(dependent)
        lines.append(
            f"  {_listed(group)}: {seen} combination{'s' * (seen > 1)} of {len(group)}; "
            f"{'; '.join(_relation_words(r) for r in dependent[:2])}"
        )
    more = len(found.exact_groups) - SHOWN
    lines += [f"  ... and {more} more groups (--json lists them)"] if more > 0 else []
    return "Cannot be told apart at these poses, however often they are read:\n" + "\n".join(lines)


def _relation_words(relation: Relation) -> str:
    if len(relation.like) > 4:
        return f"{relation.name} looks like {len(relation.like)} others together"
    terms = " and ".join(f"{factor:.4g} of {other}" for other, factor in relation.like)
    return f"1 of {relation.name} looks like {terms or 'nothing'}"


def _listed(names: Sequence[str]) -> str:
    if len(names) <= 8:
        return ", ".join(names)
    return ", ".join([*names[:6], f"... ({len(names)} in all)"])


def _practical_words(found: Identifiability, own: set[str]) -> str:
    ratio = dict(zip(found.names, found.sigma_ratio, strict=True))
    sharp = dict(zip(found.names, found.identified, strict=True))
    known = sum(sharp[name] for name in own)
    text = (
        f"Identified (uncertainty less than half of the tolerance): {known} of {len(own)} "
        "parameters."
    )
    groups = [g for g in found.practical_groups if any(not sharp[n] and n in own for n in g)]
    if not groups:
        return text
    alone = [g[0] for g in groups if len(g) == 1]
    lines = []
    if alone:
        named = [f"{n} ({100 * ratio[n]:.0f} %)" for n in alone]
        lines.append(f"  by themselves too weak (in % of the prior): {', '.join(named)}")
    lines += [f"  only together: {_listed(g)}" for g in groups if len(g) > 1][:SHOWN]
    return text + " The others:\n" + "\n".join(lines)


def _gauge_words(gauge: Gauges) -> str:
    text = (
        f"Gauge freedoms if base frame and nests were both unknown: {gauge.exact + gauge.weak} of "
        f"12 rigid motions, {gauge.exact} exactly and {gauge.weak} in practice."
    )
    for verdict, says in (
        ("hidden", "each by itself hidden by the parameters"),
        ("nearly hidden", "by itself nearly hidden (visible part)"),
        ("visible", "by itself visible"),
    ):
        held = [m for m in gauge.motions if m.verdict == verdict]
        if held:
            shown = [
                f"{m.body} {m.motion}"
                + (f" ({100 * m.visible:.2g} %)" if verdict != "hidden" else "")
                for m in held
            ]
            text += f"\n  {says}: {', '.join(shown)}"
    if gauge.alike:
        pairs = ", ".join(f"{a} and {b}" for a, b in gauge.alike)
        text += f"\n  the same to every reading: {pairs}"
    return text


def _subset_words(subsets: Sequence[SubsetResult]) -> str:
    rows = [
        [s.says, str(s.count), str(s.rank), f"{s.position_um:.1f}", f"{s.orientation_mdeg:.2f}"]
        for s in subsets
    ]
    header = ["What is fitted", "unknowns", "independent", "position um", "orientation mdeg"]
    return "Sensitivity is not identifiability. Predicted RMS at fresh poses:\n" + text_table(
        header, rows
    )


def _option_words(benefits: Sequence[Option]) -> str:
    rows = [
        [
            o.says,
            f"{o.rank} of {o.unknowns}",
            f"{o.identified} of {o.parameters}",
            f"{o.position_um:.1f}",
            f"{o.orientation_mdeg:.2f}",
        ]
        for o in benefits
    ]
    header = ["What is read", "rank", "identified", "position um", "orientation mdeg"]
    return "What another reading would buy (with priors):\n" + text_table(header, rows)
