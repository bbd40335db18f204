"""Pages that the site makes: of the verbs from their help, of the packages from docstrings."""

import pkgutil
import re
from importlib import import_module
from pathlib import Path

from app.cli import TASKS, file_of, pkmcal

PACKAGES = ("pkmcal", "app.jobs", "calib")
"""The scripting interface, what it hands on, and the mathematics under it."""

INDEX = """\
Programming interface
=====================

Scripts use :mod:`pkmcal`, whose questions and reports are those of :mod:`app.jobs`; the packages of
:mod:`calib` are what it stands on.

.. toctree::
   :maxdepth: 1

"""

VERBS = """\
The verbs
=========

What ``pkmcal VERB --help`` says, of every verb, in the order in which an operator works. Exit
codes: 0 answered, 2 bad input or usage, 3 hardware fault, 4 stopped by the operator, 5 refused by a
safety gate.

"""


def write_pages(folder: Path) -> None:
    """Write all pages into a folder; what is as it was stays, what is no more is deleted."""
    folder.mkdir(exist_ok=True)
    pages = {name: page(name) for name in packages()}
    index = INDEX + "".join(f"   {name}\n" for name in pages)
    pages |= {"api": index, "verbs": verbs()}
    for path in folder.glob("*.rst"):
        if path.stem not in pages:
            path.unlink()
    for name, text in pages.items():
        path = folder / f"{name}.rst"
        if not path.exists() or path.read_text(encoding="utf-8") != text:
            path.write_text(text, encoding="utf-8")


def verbs() -> str:
    """The page of the verbs, by task."""
    left = pkmcal.list_commands(pkmcal.make_context("pkmcal", [], resilient_parsing=True))
    lines: list[str] = []
    for task, names in (*TASKS, ("Other", tuple(left))):
        here = [name for name in names if name in left]
        left = [name for name in left if name not in here]
        if here:
            lines += [task, "-" * len(task), ""]
        for name in here:
            lines += [
                f".. click:: app.verbs.{file_of(name).stem}:command",
                f"   :prog: pkmcal {name}",
            ]
            lines += ["   :nested: full", ""]
    return VERBS + "\n".join(lines)


def packages() -> list[str]:
    """The packages of which there is a page."""
    found = []
    for name in PACKAGES:
        found.append(name)
        inner = pkgutil.iter_modules(import_module(name).__path__, f"{name}.")
        found += [module.name for module in inner if module.ispkg]
    return found


def page(package: str) -> str:
    """A page: what the package says, then what it offers by name, or else each of its modules."""
    lines = [package, "=" * len(package), "", f".. automodule:: {package}", "   :no-members:", ""]
    if package == PACKAGES[0]:
        return "\n".join(lines + offered(package))
    for module in modules(package):
        short = module.removeprefix(f"{package}.")
        lines += [short, "-" * len(short), "", f".. automodule:: {module}", ""]
    return "\n".join(lines)


def offered(package: str) -> list[str]:
    """What scripts import from a package, kind by kind."""
    module = import_module(package)
    kinds: dict[str, list[str]] = {name: [] for name in ("function", "class", "exception")}
    for name in module.__all__:
        thing = getattr(module, name)
        failure = isinstance(thing, type) and issubclass(thing, Exception)
        kind = "exception" if failure else "class" if isinstance(thing, type) else "function"
        kinds[kind] += [f".. auto{kind}:: {package}.{name}", ""]
    lines: list[str] = []
    for heading, kind in (("Calls", "function"), ("Stations and answers", "class"),
                          ("What goes wrong", "exception")):  # fmt: skip
        lines += [heading, "-" * len(heading), "", *kinds[kind]]
    return lines


def modules(package: str) -> list[str]:
    """The modules of a package that are for others."""
    inner = pkgutil.iter_modules(import_module(package).__path__, f"{package}.")
    return [
        module.name
        for module in inner
        if not module.ispkg and not module.name.rpartition(".")[2].startswith("_")
    ]


ARRAY = re.compile(
    r"(~?)numpy\.ndarray\[tuple\[~?typing\.Any, \.\.\.\], ~?numpy\.dtype\[~?numpy\.float64\]\]"
)
LITERAL = re.compile(r"(``.+?``|:[a-z]+:`[^`]+`)", re.DOTALL)
SIGNS = re.compile(r"(?<!\\)([*|]|(?<=\w)_(?!\w))")
BOLD = re.compile(r"(\*\*\w[^*\n]*\w\.?\*\*)")
ITEM = re.compile(r"\s*([-*] |\d+[.)] )")


def readable(app, what, name, obj, options, lines: list[str]) -> None:
    """Make reStructuredText of a docstring that is written for people.

    ``|e|`` and ``A * B`` are what they look like, and indented lines after a blank line, which
    are formulas and tables of numbers here, keep their shape.
    """
    lines[:] = _shaped([_escaped(line) for line in lines])


def _escaped(line: str) -> str:
    """A line whose signs mean nothing but themselves, outside ``code``, roles and bold words."""
    parts = LITERAL.split(line)
    for place in range(0, len(parts), 2):
        pieces = BOLD.split(parts[place])
        pieces[::2] = [SIGNS.sub(r"\\\1", piece) for piece in pieces[::2]]
        parts[place] = "".join(pieces)
    return "".join(parts)


def _shaped(lines: list[str]) -> list[str]:
    """Lines with ``::`` before every indented block that stands apart."""
    shaped: list[str] = []
    last, inside = "", False
    for place, line in enumerate(lines):
        indented = line.startswith("    ")
        apart = place > 0 and not lines[place - 1].strip()
        if indented and apart and last and not last.startswith(" ") and not ITEM.match(last):
            if not last.endswith("::"):
                shaped += ["::", ""]
            inside = True
        elif line.strip() and not indented:
            inside = False
        shaped.append(line.replace("\\", "") if inside else line)
        last = line if line.strip() else last
    return shaped


def short_types(app, what, name, obj, options, signature: str | None, returns: str | None):
    """Hook of Sphinx: arrays are called as the code calls them."""
    return tuple(text and ARRAY.sub(r"\1Array", text) for text in (signature, returns))
