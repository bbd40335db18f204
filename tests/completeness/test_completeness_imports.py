"""What a verb brings along is what it uses: start-up is most of the time of a short verb."""

import subprocess
import sys

import pytest

HEAVY = {
    "import app.analysis, app.verbs.fit, app.verbs.discover, app.verbs.measure": (
        "scipy.stats", "scipy.optimize", "scipy.spatial", "matplotlib", "textual", "canopen",
    ),
    "import pkmcal": ("numpy", "scipy", "click", "textual"),
    "import app.tui.program": ("scipy.stats", "matplotlib"),
}  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("statement", HEAVY)
def test_nothing_is_imported_that_is_not_used(statement: str) -> None:
    asked = f"import sys; {statement}; print(*sys.modules)"
    done = subprocess.run(
        [sys.executable, "-c", asked], capture_output=True, text=True, check=True, timeout=100
    )
    assert set(done.stdout.split()) & set(HEAVY[statement]) == set()
