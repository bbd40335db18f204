"""What a bench writes into a page, between ``<!-- MARK -->`` and ``<!-- end -->``."""

import os
import re
import resource
import subprocess
from collections.abc import Iterable
from datetime import UTC, datetime
from pathlib import Path

ROOT = Path(__file__).parents[1]


def table(head: Iterable[str], lines: Iterable[Iterable[str]]) -> str:
    """A table of a page."""
    head = list(head)
    parts = [head, ["---"] * len(head), *map(list, lines)]
    return "\n".join("| " + " | ".join(cells) + " |" for cells in parts)


def put(page: Path, mark: str, text: str) -> None:
    """Put a text in place of what stands between the marks."""
    whole = page.read_text(encoding="utf-8")
    pattern = re.compile(rf"(<!-- {mark} -->\n)(.*?)(<!-- end -->)", re.DOTALL)
    if pattern.search(whole) is None:
        raise SystemExit(f"{page} has no marks <!-- {mark} --> and <!-- end -->")
    made = pattern.sub(lambda marks: f"{marks[1]}\n{text}\n\n{marks[3]}", whole)
    page.write_text(made, encoding="utf-8")


def today() -> str:
    """Date and commit of what is measured here."""
    return f"{datetime.now(UTC):%d %B %Y} at {commit()}"


def commit() -> str:
    """The commit that was run, with a plus where files differed from it."""

    def git(*words: str) -> str:
        done = subprocess.run(
            ["git", *words], cwd=ROOT, capture_output=True, text=True, check=False
        )
        return done.stdout.strip()

    return git("rev-parse", "--short", "HEAD") + (
        "+" if git("status", "--porcelain", "-uno") else ""
    )


def load() -> str:
    """What else this computer did."""
    own = resource.getrusage(resource.RUSAGE_SELF)
    return f"load {os.getloadavg()[0]:.0f}, {own.ru_utime + own.ru_stime:.0f} s of CPU here"
