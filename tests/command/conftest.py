"""A model as a lab has it: fitted to a run with two payloads and a warm day, and saved."""

from pathlib import Path

import pytest

import pkmcal


@pytest.fixture(scope="session")
def model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("correct")
    pkmcal.simulate(
        "hexapod",
        folder / "run",
        seed=3,
        poses=24,
        payload=(0.0, 5.0),
        effects={"gravity-sag.c": 5e-5, "backlash.leg1": 0.02},
    )
    found = pkmcal.fit(folder / "run", add=["gravity-sag", "backlash", "tracker-scale"])
    found.save(folder / "model.toml")
    return folder / "model.toml"
