"""A verification ends with its verdict; an answer that could not be kept is refused at once."""

import asyncio
import contextlib
import json
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner
from session_mock import POSES, Mock, site_text

from app.cli import pkmcal
from app.errors import StoppedByOperator
from app.jobs.verifying import VERDICT, begin_verifying, concluded
from app.session import events as ev
from app.session.session import Session
from calib.errors import BadInput

TWO = {label: POSES[label] for label in "ab"}


def stopped_verification(mock: Mock, folder: Path, before: Path, save: Path) -> Session:
    """Begin a verification, and stop it at its first reading of a pose."""

    async def begun() -> Session:
        session = begin_verifying(
            mock.site, TWO, folder=folder, before=before, save=save, unattended=True
        )

        def stop_at_a_pose(event: ev.Event) -> None:
            if isinstance(event, ev.ReadingTaken) and event.pose_label:
                stops.append(asyncio.ensure_future(session.stop()))

        stops: list[asyncio.Future[None]] = []
        session.observers.watch(stop_at_a_pose)
        with contextlib.suppress(StoppedByOperator):
            await session.run()
        await asyncio.gather(*stops)
        await session.close()
        assert stops
        return session

    return asyncio.run(begun())


@pytest.mark.long
def test_a_verification_that_was_stopped_ends_with_its_verdict(
    mock_of: Callable[..., Mock], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    mock = mock_of("--smrs", "3")
    units = {"position": "um", "orientation": "deg"}
    earlier = {f"{k}_{how}_{units[k]}": 1.0 for k in units for how in ("peak", "std", "rms")}
    noise = {"position_peak_um": 9.0, "orientation_peak_deg": 0.01}
    said = {"format": "pkm-verification/1", "measured": earlier, "truth": None}
    (tmp_path / "before.json").write_text(json.dumps({**said, "noise_alone": noise}))
    monkeypatch.chdir(tmp_path)
    session = stopped_verification(mock, tmp_path / "sessions", Path("before.json"), Path("s.json"))
    with pytest.raises(BadInput):
        concluded(session.folder)
    assert not (tmp_path / "s.json").exists()
    monkeypatch.chdir(tmp_path.parent)  # the session knows its files from everywhere
    done = CliRunner().invoke(pkmcal, ["resume", str(session.folder), "--json"])
    assert done.exit_code == 0, done.output
    answer = json.loads(done.stdout)
    assert answer["format"] == "pkm-verification/1"
    assert [one["pose"] for one in answer["errors"]] == ["a", "b"]
    assert answer["measured"]["position_peak_um"] > 100.0
    assert answer["before"]["measured"] == earlier
    for kept in (tmp_path / "s.json", session.folder / VERDICT):
        assert json.loads(kept.read_text(encoding="utf-8")) == answer
    (tmp_path / "s.json").unlink()
    elsewhere = session.folder.rename(tmp_path / "copied")
    (elsewhere / VERDICT).unlink()
    concluded(elsewhere)  # a session that was carried here writes nothing outside of its folder
    assert (elsewhere / VERDICT).is_file()
    assert not (tmp_path / "s.json").exists()


@pytest.mark.parametrize(
    "arguments",
    [
        ["verify", "--site", "site.toml", "--save", "none/after.json"],
        ["verify", "--site", "site.toml", "--save", "site.toml/after.json"],
        ["verify", "--site", "site.toml", "--save", "."],
        ["fit", "run", "--save", "none/model.toml"],
        ["discover", "run", "--save", "none/model.toml"],
        ["poses", "hexapod", "--out", "none/poses.toml"],
        ["design", "run", "--discriminate", "backlash", "nothing", "--out", "none/poses.toml"],
        ["correct", "model.toml", "--out", "none/commands.csv"],
    ],
    ids=lambda arguments: f"{arguments[0]} {arguments[-1]}",
)
def test_an_answer_that_could_not_be_kept_is_refused_before_anything_is_done(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, arguments: list[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "site.toml").write_text(site_text(), encoding="utf-8")
    done = CliRunner().invoke(pkmcal, arguments)
    assert isinstance(done.exception, BadInput)
    assert arguments[-1] in str(done.exception)
    assert [path.name for path in tmp_path.iterdir()] == ["site.toml"]
