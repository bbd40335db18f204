"""State of its own for every test, and a driver of motors on a line as an installed package."""

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from app.devices import _found

EXAMPLE = Path(__file__).parents[2] / "examples" / "line_motors"
POINT = "[pkmcal.controllers]\nline-motors = line_motors:KIND\n"


@pytest.fixture(autouse=True)
def own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PKMCAL_STATE", str(tmp_path / "state"))


@pytest.fixture
def line_kind(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """The folder of an installed package that offers the kind ``line-motors``."""
    folder = tmp_path / "installed"
    about = folder / "line_motors-1.0.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text("Metadata-Version: 2.1\nName: line-motors\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(POINT)
    monkeypatch.setattr(sys, "path", [str(folder), str(EXAMPLE), *sys.path])
    _found.cache_clear()
    yield folder
    _found.cache_clear()
