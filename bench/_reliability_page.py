"""docs/reliability.md: a row of a table for each command that was run, with its date.

A table stands between ``<!-- NAME -->`` and ``<!-- end -->``. What a command of the same words said
before is replaced; the text around the tables is written by hand.
"""

import re
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from bench._page_table import ROOT, commit

PAGE = ROOT / "docs" / "reliability.md"
HEAD = "| what ran | what came of it | command | date | of |\n|---|---|---|---|---|\n"


@dataclass(frozen=True)
class Row:
    """A command (behind ``python -m bench``), what ran, and what came of it."""

    command: str
    ran: str
    found: str


def write_row(table: str, row: Row, page: Path = PAGE) -> None:
    """Put a row into its table, in place of an older one of the same command."""
    text = page.read_text(encoding="utf-8")
    pattern = re.compile(rf"(<!-- {table} -->\n)(.*?)(<!-- end -->)", re.DOTALL)
    found = pattern.search(text)
    if found is None:
        raise SystemExit(f"{page} has no table {table}")
    kept = [
        line
        for line in found[2].splitlines()[2:]
        if line.strip() and f"| `bench {row.command}` |" not in line
    ]
    today = datetime.now(UTC).date().isoformat()
    kept.append(f"| {row.ran} | {row.found} | `bench {row.command}` | {today} | {commit()} |")
    new = f"{found[1]}{HEAD}" + "\n".join(kept) + f"\n{found[3]}"
    page.write_text(text[: found.start()] + new + text[found.end() :], encoding="utf-8")
