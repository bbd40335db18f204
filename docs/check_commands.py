"""Run the commands of documentation pages and look for the output that they show.

python docs/check_commands.py docs/tutorial-mystery.md ...

In blocks fenced by three backquotes, ``$ pkmcal ...`` is a command, what follows is its output, and
``...`` stands for lines left out, or for what is left out of a line. Commands run in the folder of
the clone; files that they write go there too, so use a copy. Exit code 1 if a line shown was not
printed.
"""

import re
import shlex
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent.parent
BLOCK = re.compile(r"^```[a-z]*\n(.*?)^```", re.MULTILINE | re.DOTALL)
LONGEST_S = 300.0


def commands_of(page: Path) -> list[tuple[str, list[str]]]:
    """Commands of a page, each with the lines of output that the page shows."""
    found: list[tuple[str, list[str]]] = []
    for block in BLOCK.findall(page.read_text(encoding="utf-8")):
        shown: list[str] | None = None
        for line in block.splitlines():
            if line.startswith("$ pkmcal "):
                shown = []
                found.append((line.removeprefix("$ pkmcal "), shown))
            elif shown is not None and line.strip() not in ("", "..."):
                shown.append(line.strip())
    return found


def missing(command: str, shown: list[str]) -> list[str]:
    """Lines shown that the command does not print."""
    words = [sys.executable, "-m", "pkmcal", *shlex.split(command, comments=True)]
    done = subprocess.run(
        words, cwd=HERE, stdout=subprocess.PIPE, text=True, timeout=LONGEST_S, check=False
    )
    printed = {" ".join(line.split()) for line in done.stdout.splitlines()}
    lacking = [line for line in shown if " ".join(line.split()) not in printed]
    return lacking if done.returncode == 0 else [f"exit code {done.returncode}", *lacking]


def main() -> int:
    """Check all pages that the command line names."""
    wrong = 0
    for page in map(Path, sys.argv[1:]):
        for command, shown in commands_of(page):
            lacking = missing(command, shown)
            wrong += len(lacking)
            print(f"{'ok  ' if not lacking else 'DIFF'} {page.name}: pkmcal {command}", flush=True)
            for line in lacking:
                print(f"     not printed: {line}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
