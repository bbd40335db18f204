"""What is wrong with the record of a run, before any physics: a plain hypothesis, said first."""

from collections.abc import Collection, Iterable
from dataclasses import dataclass
from typing import Any

Ranges = tuple[tuple[int, int], ...]
"""Lines of ``points.csv`` as (first, last)."""


@dataclass(frozen=True)
class Remark:
    """A hypothesis about the record itself, and what was done about it.

    Attributes
    ----------
    name : str
        Its kind, ``nests-exchanged``.
    says : str
        One sentence for the operator.
    lines : tuple of (first, last)
        Lines of ``points.csv`` that it concerns; empty if it is of the whole run.
    evidence, done, remedy : str
        Why it is held; what the analysis did about it; what to change in the files.
    settled : bool
        Whether the rest of the analysis can be taken as it is. Where it cannot, no model is
        adequate.
    run : str
        The points file.
    """

    name: str
    says: str
    lines: Ranges
    evidence: str
    done: str
    remedy: str
    settled: bool
    run: str = ""


def plain_remarks(remarks: Iterable[Remark]) -> list[dict[str, Any]]:
    """Remarks as plain data, for the key ``record`` of an answer."""
    return [{**vars(one), "lines": [list(pair) for pair in one.lines]} for one in remarks]


def ranges(lines: Iterable[int], among: Collection[int] = ()) -> Ranges:
    """Successive lines as (first, last); lines between that are not ``among`` break nothing.

    Parameters
    ----------
    lines : iterable of int
    among : collection of int (or array), optional
        Lines that could be meant at all, if not all.
    """
    chosen = sorted({int(line) for line in lines})
    kept = sorted({*map(int, among), *chosen}) if len(among) else None
    place = {line: index for index, line in enumerate(kept)} if kept else None
    found: list[tuple[int, int]] = []
    for line in chosen:
        last = found[-1][1] if found else None
        if last is not None and (place[line] - place[last] if place else line - last) == 1:
            found[-1] = (found[-1][0], line)
        else:
            found.append((line, line))
    return tuple(found)


def lines_in_words(found: Ranges, most: int = 6) -> str:
    """``line 12``, ``lines 7-26``, ``lines 7-9, 12 and 4 more ranges``."""
    shown = [f"{a}" if a == b else f"{a}-{b}" for a, b in found[:most]]
    rest = len(found) - most
    single = len(found) == 1 and found[0][0] == found[0][1]
    more = f" and {rest} more" if rest > 0 else ""
    return f"{'line' if single else 'lines'} {', '.join(shown)}{more}"
