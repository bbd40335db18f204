from pathlib import Path

import pytest

import pkmcal


@pytest.fixture(autouse=True)
def own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PKMCAL_STATE", str(tmp_path / "state"))


@pytest.fixture(scope="session")
def run_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small run of a hexapod with play in one leg."""
    folder = tmp_path_factory.mktemp("scripting") / "run"
    pkmcal.simulate("hexapod", folder, seed=5, poses=20, effects={"backlash.leg3": 0.03})
    return folder
