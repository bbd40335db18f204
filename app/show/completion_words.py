"""What a machine file lacks, in words."""

from collections.abc import Mapping
from typing import Any

from app.show.text_table import text_table


def completion_words(report: Mapping[str, Any]) -> str:
    """The answer of ``pkmcal machine complete`` for a person."""
    head = (
        f"{report['machine']}: {report['parameters']} parameters, {report['rank_before']} "
        f"independent; {report['tried']} errors put at the base and behind every joint would make "
        f"it {report['rank_after']}."
    )
    entries = report["lacking"]
    if not entries:
        return f"{head}\nNothing is lacking: the file's parameters imitate every one of them."
    table = text_table(
        ("error", "limb", "element", "behind joint", "beyond the file, um", ""),
        [
            (
                one["name"],
                one["limb"],
                one["element"],
                str(one["joint"]) if one["joint"] else "the base",
                f"{one['beyond_um']:.1f}",
                "nests on the flange" if one["tool"] else "",
            )
            for one in entries
        ],
    )
    parts = [head, "", table]
    if report["proposal"]:
        parts += ["", "In the file's words:", "", report["proposal"]]
    if any(one["tool"] for one in entries):
        parts += [
            "",
            "Errors of the nests on the flange count where their places are not known: --tool.",
        ]
    return "\n".join(parts)
