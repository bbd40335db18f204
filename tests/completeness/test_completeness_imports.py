"""What a verb brings along is what it uses: start-up is most of the time of a short verb."""

import subprocess
import sys
from pathlib import Path

import pytest

from app.cli import TASKS

ASKED = [verb for _, verbs in TASKS for verb in verbs] + ["machine check", "machine new"]
ENGINE = {"numpy", "scipy", "calib.mechanism", "app.jobs.fitting", "app.session.session"}
FACES = {"matplotlib", "textual", "rich", "typst", "jinja2"}
WIRES = {"canopen", "can", "serial", "sqlite3", "importlib.metadata"}
HEAVY = {
    "import app.analysis, app.jobs.discovering": ("scipy.stats", "scipy.optimize", *FACES, *WIRES),
    "import app.jobs.fitting": ("calib.evidence.diagnosis", "calib.discover.discovery", "zipfile"),
    "import pkmcal": ("numpy", "scipy", "click", "textual"),
    "import app.tui.program": ("scipy", "matplotlib"),
}


def loaded(statement: str) -> set[str]:
    """Modules that a process has at its end."""
    code = f"import sys; {statement}; print(*sys.modules, file=sys.stderr)"
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True, timeout=100
    )
    return set(done.stderr.splitlines()[-1].split())


def test_the_help_of_no_verb_loads_what_answers() -> None:
    asked = [[], *(verb.split() for verb in ASKED)]
    had = loaded(f"from app.cli import run; [run([*verb, '--help']) for verb in {asked}]")
    assert had & (ENGINE | FACES | WIRES) == set()
    assert "app.verbs.fit" in had


def test_a_fit_loads_neither_screens_nor_figures_nor_drivers_nor_scipy(tmp_path: Path) -> None:
    run = str(tmp_path / "run")
    had = loaded(
        "from app.cli import run; "
        f"run(['simulate', 'tripod', '--out', {run!r}, '--poses', '12', '--seed', '4']); "
        f"before = set(sys.modules); assert run(['fit', {run!r}]) == 0"
    )
    assert had & (FACES | WIRES | {"scipy"}) == set()
    assert "calib.identify.fitting" in had


@pytest.mark.parametrize("statement", HEAVY)
def test_nothing_is_imported_that_is_not_used(statement: str) -> None:
    assert loaded(statement) & set(HEAVY[statement]) == set()
