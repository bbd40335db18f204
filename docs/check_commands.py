"""Run the commands that documentation pages show, and look for the output that they show.

python docs/check_commands.py [PAGE ...]        all pages, if none is named
python docs/check_commands.py --short           all but those that take minutes: ``check: minutes``

In fenced blocks ``$ pkmcal ...`` is a command, what follows is its output, and ``...`` stands for
lines left out, or for what is left out of a line. Every page is worked through in a folder of its
own that holds nothing but a copy of ``tests/data``, which is in every clone. A mock machine that a
page starts runs until the page ends. There is no person here, so ``apply`` is told to keep what
passes its gates. Comments in a page, unseen by its readers, say what the words do not:

``<!-- check: numbers differ -->``    before the first block: in the output of this page every
                                      number may be another one; as measurements take place in
                                      real time, such a page has a second try
``<!-- check: minutes -->``           anywhere: the page takes minutes, as a machine moves
``<!-- check: example -->``           before a block: its commands run, their output is not compared
``<!-- check: run -->``               before a block without ``$``: each line is a command
``<!-- check: file NAME -->``         before a block: it is written to this file

Exit code 1 if a line shown was not printed, or a command ended otherwise than the page says.
"""

import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack
from dataclasses import dataclass, field
from pathlib import Path

CLONE = Path(__file__).resolve().parent.parent
BLOCK = re.compile(
    r"(?:^<!-- check: (?P<mark>[^>]*?) -->\n+)?^```[a-z]*\n(?P<text>.*?)^```$",
    re.MULTILINE | re.DOTALL,
)
MINUTES = "<!-- check: minutes -->"
NUMBERS_DIFFER = "<!-- check: numbers differ -->"
PROGRAM = (sys.executable, "-m", "pkmcal")
LONGEST_S = 300.0
EXIT_REFUSED = 5


@dataclass
class Command:
    """A command of a page, and what the page says of it."""

    line: str
    shown: list[str] = field(default_factory=list)
    compared: bool = True

    @property
    def words(self) -> list[str]:
        """Arguments of the program as a shell would make them, comments and ``&`` left off."""
        return [w for w in shlex.split(self.line, comments=True)[1:] if w != "&"]

    @property
    def stays(self) -> bool:
        """Whether the command is a mock machine, which runs until it is stopped."""
        return self.words[0] == "mock" and self.words[1] != "do"

    @property
    def refused(self) -> bool:
        """Whether the page shows that the program refuses."""
        return any(line.startswith("pkmcal: refused") for line in self.shown)


@dataclass
class File:
    """A file that the page tells its reader to write."""

    name: str
    text: str


def steps_of(text: str) -> list[Command | File]:
    """What a page has its reader do, in order."""
    steps: list[Command | File] = []
    for block in BLOCK.finditer(text):
        mark, body = block["mark"] or "", block["text"]
        if mark.startswith("file "):
            steps.append(File(mark.removeprefix("file "), body))
        elif mark == "run":
            steps += [Command(line) for line in body.splitlines() if line.startswith("pkmcal ")]
        else:
            steps += _shown_commands(body, compared=mark != "example")
    return steps


def _shown_commands(block: str, compared: bool) -> Iterator[Command]:
    """Commands of a block after ``$``, each with the lines of output that follow it."""
    command: Command | None = None
    for line in block.splitlines():
        if line.startswith("$ "):
            if command is not None:
                yield command
            known = line.startswith("$ pkmcal ")
            command = Command(line.removeprefix("$ "), compared=compared) if known else None
        elif command is not None and line.strip() not in ("", "..."):
            command.shown.append(line.strip())
    if command is not None:
        yield command


def lacking(command: Command, done: subprocess.CompletedProcess[str], blurred: bool) -> list[str]:
    """What the page says and the command did not do; with ``blurred`` numbers may differ."""
    wanted = EXIT_REFUSED if command.refused else 0
    wrong = [] if done.returncode == wanted else [f"exit code {wanted}, but {done.returncode}"]
    if wrong:
        wrong += [f"it said: {line}" for line in done.stderr.splitlines()[-5:]]
    if not command.compared:
        return wrong
    printed = {_plain(line, blurred) for line in (done.stdout + done.stderr).splitlines()}
    return wrong + [line for line in command.shown if not _is_printed(line, printed, blurred)]


def _is_printed(line: str, printed: set[str], blurred: bool) -> bool:
    """Whether a line shown is among those printed; ``...`` at its end stands for anything."""
    plain = _plain(line, blurred)
    if plain.endswith("..."):
        return any(other.startswith(plain.removesuffix("...")) for other in printed)
    return plain in printed


def _plain(line: str, blurred: bool) -> str:
    """A line without what does not count: width of gaps and, if asked, its figures and bars."""
    if blurred:
        line = re.sub(r"[-+]?\d+(\.\d+)?(e[-+]?\d+)?", "0", line)
        line = re.sub(r"#+|[-+](?=0)", "", line)
    return " ".join(line.split())


def check(page: Path) -> int:
    """Work through one page; the number of things that are not as it says."""
    text = page.read_text(encoding="utf-8")
    blurred = NUMBERS_DIFFER in text
    wrong = _work_through(page, steps_of(text), blurred)
    if wrong and blurred:
        print(f"{page.name} once more: two measurements are never the same", flush=True)
        wrong = _work_through(page, steps_of(text), blurred)
    return wrong


def _work_through(page: Path, steps: list[Command | File], blurred: bool) -> int:
    """Do what a page says in a folder of its own, a line a command; how much was wrong."""
    wrong = 0
    with ExitStack() as ends:
        folder = Path(ends.enter_context(tempfile.TemporaryDirectory(prefix="pkmcal-docs-")))
        shutil.copytree(CLONE / "tests" / "data", folder / "tests" / "data")
        shell = Shell(folder, {**os.environ, "PKMCAL_STATE": str(folder / "state")}, ends)
        for step in steps:
            if isinstance(step, File):
                (folder / step.name).write_text(step.text, encoding="utf-8")
                continue
            began = time.monotonic()
            said = shell.start(step) if step.stays else lacking(step, shell.run(step), blurred)
            took = f"{time.monotonic() - began:5.1f} s"
            answer = [f"{'DIFF' if said else 'ok  '} {took}  {page.name}: {step.line}"]
            answer += [f"     {page.name}, not so: {line}" for line in said]
            print("\n".join(answer), flush=True)
            wrong += len(said)
    return wrong


@dataclass
class Shell:
    """Where a page's commands run: its folder, its environment, and the end of what it starts."""

    folder: Path
    environment: dict[str, str]
    ends: ExitStack

    def run(self, command: Command) -> subprocess.CompletedProcess[str]:
        """Run a command to its end; ``*`` stands for the files that match."""
        words: list[str] = []
        for word in command.words:
            matches = self.folder.glob(word) if "*" in word else ()
            words += sorted(str(found.relative_to(self.folder)) for found in matches) or [word]
        if words[0] == "apply" and "--yes" not in words:
            words.append("--yes")
        return subprocess.run(
            [*PROGRAM, *words],
            cwd=self.folder,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            capture_output=True,
            text=True,
            timeout=LONGEST_S,
            check=False,
        )

    def start(self, command: Command) -> list[str]:
        """Start a mock machine that ends with the page; what went wrong."""
        site = self.folder / command.words[command.words.index("--site") + 1]
        mock = subprocess.Popen(
            [*PROGRAM, *command.words],
            cwd=self.folder,
            env=self.environment,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.DEVNULL,
        )
        self.ends.callback(mock.wait)
        self.ends.callback(mock.terminate)
        deadline = time.monotonic() + LONGEST_S
        while not site.exists():
            if mock.poll() is not None or time.monotonic() > deadline:
                return ["the mock machine did not start"]
            time.sleep(0.05)
        return []


def pages() -> list[Path]:
    """Every page that shows commands, longest first, so that none is left over at the end."""
    everywhere = [CLONE / "README.md", *sorted((CLONE / "docs").rglob("*.md"))]
    steps = {page: len(steps_of(page.read_text(encoding="utf-8"))) for page in everywhere}
    return sorted((page for page in everywhere if steps[page]), key=lambda page: -steps[page])


def main(arguments: list[str]) -> int:
    """Check the pages that the command line names, or all, two at a time."""
    began = time.monotonic()
    if arguments == ["--short"]:
        chosen = [page for page in pages() if MINUTES not in page.read_text(encoding="utf-8")]
    else:
        chosen = [Path(name).resolve() for name in arguments] or pages()
    with ThreadPoolExecutor(2) as two:
        wrong = sum(two.map(check, chosen))
    print(f"{wrong} differences, {time.monotonic() - began:.0f} s")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
