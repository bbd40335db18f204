"""Commands in documentation name verbs, options and files that exist."""

import importlib.util
import re
import shlex
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import click
import pytest

from app.cli import pkmcal
from bench.__main__ import benches
from mocks.arguments import parser as station_parser

ROOT = Path(__file__).resolve().parents[2]
PAGES = [*sorted(ROOT.glob("*.md")), *sorted((ROOT / "docs").rglob("*.md"))]
OTHERS = ("bash", "lint-imports", "mypy", "ruff")
"""Programs that pages use and that are not ours."""

IN_LINE = re.compile(r"(?<!`)`((?:pkmcal|python3?|pytest) [^`\n]+)`")
BLOCK = re.compile(r"^```([a-z]*)\n(.*?)^```", re.MULTILINE | re.DOTALL)


def commands(page: Path) -> list[str]:
    """Commands of a page: in its lines, in its blocks of shell, and after ``$``."""
    text = page.read_text(encoding="utf-8")
    found = [line for line in IN_LINE.findall(BLOCK.sub("", text)) if len(line.split()) > 1]
    for language, block in BLOCK.findall(text):
        lines = [line for line in block.splitlines() if line and line[0] != "#"]
        found += [x.removeprefix("$ ") for x in lines if x.startswith("$ ") or language == "sh"]
    return [line for line in found if line not in ("pkmcal ...", "python -m")]


EVERYTHING = [
    pytest.param(line, id=f"{page.relative_to(ROOT)}: {line[:60]}")
    for page in PAGES
    for line in dict.fromkeys(commands(page))
]


def parse(words: list[str]) -> None:
    """Let click read the arguments of ``pkmcal``, without looking whether files exist."""
    command: click.Command = pkmcal
    context = click.Context(command, info_name="pkmcal")
    while isinstance(command, click.Group):
        _, words, _ = command.make_parser(context).parse_args(list(words))
        if not words:
            return
        name, command, words = command.resolve_command(context, words)
        assert command is not None, name
        context = click.Context(command, info_name=name, parent=context)
        if command.name == "mock":
            parse_mock(words)
            return
    given, left, order = command.make_parser(context).parse_args(list(words))
    assert command.name == "mock" or not left, f"{left} is too much for {command.name}"
    for parameter in order:
        if isinstance(parameter.type, click.Choice) and given[parameter.name] is not None:
            parameter.type_cast_value(context, given[parameter.name])


def parse_mock(words: list[str]) -> None:
    """Let the station's own parser read what it gets."""
    if words and words[0] != "do":
        station_parser().parse_args(words)


def run_by_python(words: list[str]) -> None:
    """Look whether what Python is to run is there."""
    if words[0] == "run.py":
        assert f"run.py {words[1]}" in (ROOT / "run.py").read_text(encoding="utf-8"), words
        if words[1] == "pkmcal":
            parse(words[2:])
        if words[1] == "bench" and len(words) > 2:
            assert words[2] in benches()
    elif words[0] == "-m":
        assert importlib.util.find_spec(words[1]), words
        if words[1] == "bench":
            assert words[2] in benches()
    else:
        assert (ROOT / words[0]).is_file(), words


@pytest.mark.parametrize("line", EVERYTHING)
def test_every_command_in_the_docs_exists(line: str):
    words = [word for word in shlex.split(line, comments=True) if word not in ("&", "...")]
    program = Path(words[0]).name
    if program == "pkmcal":
        parse(words[1:])
    elif program == "pytest":
        assert all((ROOT / word).exists() for word in words if word.startswith("tests"))
    elif program in ("python", "python3"):
        run_by_python(words[1:])
    else:
        assert program in OTHERS


@pytest.mark.parametrize(
    "line",
    [
        "pkmcal fitt RUN",
        "pkmcal fit RUN --added x",
        "pkmcal mock hexapod --octopod",
        "python no.py",
    ],
)
def test_a_command_that_does_not_exist_is_noticed(line: str):
    with pytest.raises((click.UsageError, SystemExit, AssertionError)):
        test_every_command_in_the_docs_exists(line)


@pytest.fixture(scope="module")
def checker() -> ModuleType:
    spec = importlib.util.spec_from_file_location("check_commands", ROOT / "docs/check_commands.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["check_commands"] = module
    spec.loader.exec_module(module)
    return module


def done(printed: str, code: int = 0) -> "subprocess.CompletedProcess[str]":
    return subprocess.CompletedProcess([], code, printed, "")


PAGE = """
<!-- check: file a.toml -->
```toml
a = 1
```

```
$ pkmcal fit RUN   # a comment
RMS   11.00 um
...
$ pkmcal apply m.toml
pkmcal: refused: ...
```

<!-- check: example -->
```
$ pkmcal compare RUN
other
```

<!-- check: run -->
```sh
pkmcal mock hexapod --site site.toml &
```
"""


def test_what_a_page_has_its_reader_do(checker: ModuleType):
    file, fit, apply, compare, mock = checker.steps_of(PAGE)
    assert (file.name, file.text) == ("a.toml", "a = 1\n")
    assert (fit.words, fit.shown) == (["fit", "RUN"], ["RMS   11.00 um"])
    assert apply.refused
    assert not compare.compared
    assert mock.stays
    assert mock.words[-1] == "site.toml"


def test_a_line_that_was_not_printed_is_a_difference(checker: ModuleType):
    fit = checker.steps_of(PAGE)[1]
    assert checker.lacking(fit, done("RMS 11.00 um\n"), blurred=False) == []
    assert checker.lacking(fit, done("RMS 11.01 um\n"), blurred=False) == ["RMS   11.00 um"]
    assert checker.lacking(fit, done("RMS 11.01 um\n"), blurred=True) == []
    assert checker.lacking(fit, done("RMS 11.01 mm\n"), blurred=True) == ["RMS   11.00 um"]


def test_a_wrong_exit_code_is_a_difference(checker: ModuleType):
    _, fit, apply, compare, _ = checker.steps_of(PAGE)
    assert checker.lacking(fit, done("RMS 11.00 um", 2), blurred=False)
    assert checker.lacking(apply, done("pkmcal: refused: chi2", 5), blurred=False) == []
    assert checker.lacking(apply, done("pkmcal: refused: chi2", 0), blurred=False)
    assert checker.lacking(compare, done(""), blurred=False) == []
    assert checker.lacking(compare, done("", 3), blurred=False)
