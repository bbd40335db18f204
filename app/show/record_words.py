"""What is wrong with the record of a run, said first; excluded readings in ranges."""

from collections.abc import Mapping
from typing import Any

from calib.runs.remark import lines_in_words, ranges

MOST_LINES = 8
"""Excluded readings that are listed one by one."""


def record_lines(report: Mapping[str, Any]) -> list[str]:
    """The first lines of an answer: each hypothesis, why, what was done, what to change."""
    lines: list[str] = []
    for one in report.get("record", ()):
        lines += [
            f"FIRST: {one['says']}.",
            f"  {one['evidence']}.",
            f"  {one['done']}. {one['remedy']}.",
        ]
    return [*lines, ""] if lines else []


def of_noise(report: Mapping[str, Any]) -> list[str]:
    """What RMS, floors and chi-square count with, where noise other than the stated was found."""
    if not report["noise"]["components"]:
        return []
    return [
        "(perfect: with the noise that was found, whatever makes it; chi-square: by the stated "
        "uncertainties)"
    ]


def remark_lines(report: Mapping[str, Any]) -> list[str]:
    """One line for each hypothesis, for screens: what is wrong, what was done about it."""
    return [f"{one['says']}. {one['done']}." for one in report.get("record", ())]


def excluded_lines(report: Mapping[str, Any]) -> list[str]:
    """Excluded readings, one a line while they are few, else in ranges by their reason."""
    bad = report["bad_readings"]
    if len(bad) <= MOST_LINES:
        return [f"line {one['line']}: {one['why']}" for one in bad]
    found: dict[tuple[str, str], list[int]] = {}
    for one in bad:
        found.setdefault((one.get("run", ""), kind_of(one["why"])), []).append(one["line"])
    return [
        f"{f'{run}, ' if run else ''}{lines_in_words(ranges(lines))}: {kind} ({len(lines)})"
        for (run, kind), lines in found.items()
    ]


def kind_of(why: str) -> str:
    """The reason without its size: what readings share."""
    if " from where " in why and "in no other nest" in why:
        moved = why.partition("in no other nest")[2]
        return f"where no nest is{moved}"
    return "strays, each by itself" if why.startswith("stray") else why
