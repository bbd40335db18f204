from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from session_mock import SCALE, Heard, Mock, start_mock


@pytest.fixture
def mock_of() -> Iterator[Callable[..., Mock]]:
    """Start mocks with these arguments; all end with the test."""
    started: list[Mock] = []

    def start(*arguments: str, scale: float = SCALE) -> Mock:
        started.append(start_mock(*arguments, scale=scale))
        return started[-1]

    yield start
    for mock in started:
        mock.end()


@pytest.fixture(autouse=True)
def own_state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PKMCAL_STATE", str(tmp_path / "state"))


@pytest.fixture
def heard() -> Heard:
    return Heard()
