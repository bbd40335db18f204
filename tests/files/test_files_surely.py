"""Files are whole or absent, and those of parameters belong to one user."""

import os
import stat
from pathlib import Path

import pytest

from app.surely import write_surely

posix = pytest.mark.skipif(os.name != "posix", reason="rights of POSIX")


def rights(path: Path) -> int:
    return stat.S_IMODE(path.stat().st_mode)


def names(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@posix
@pytest.mark.parametrize(
    ("folder", "expected"), [(0o700, 0o600), (0o777, 0o660), (0o755, 0o640), (0o770, 0o660)]
)
def test_a_file_of_parameters_is_for_its_owner_and_who_may_enter_the_folder_s_group(
    tmp_path: Path, folder: int, expected: int
) -> None:
    tmp_path.chmod(folder)
    before = os.umask(0)
    try:
        write_surely(tmp_path / "set.json", "{}", private=True)
        write_surely(tmp_path / "model.toml", "a = 1\n")
    finally:
        os.umask(before)
    assert rights(tmp_path / "set.json") == expected
    assert rights(tmp_path / "model.toml") == 0o666
    assert names(tmp_path) == ["model.toml", "set.json"]


@posix
def test_a_draft_that_somebody_laid_there_leads_nowhere(tmp_path: Path) -> None:
    other = tmp_path / "other"
    other.write_text("mine", "utf-8")
    (tmp_path / "set.json.draft").symlink_to(other)
    write_surely(tmp_path / "set.json", "{}", private=True)
    assert other.read_text("utf-8") == "mine"
    assert not (tmp_path / "set.json").is_symlink()


def test_what_cannot_be_written_leaves_the_old_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "set.json"
    write_surely(path, "old")

    def full(handle: int) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space"):
        write_surely(path, "new")
    assert path.read_text("utf-8") == "old"
    assert names(tmp_path) == ["set.json"]


def test_a_link_stays_one_and_a_pipe_is_written_to(tmp_path: Path) -> None:
    (tmp_path / "real").mkdir()
    link = tmp_path / "model.toml"
    link.symlink_to(tmp_path / "real" / "model.toml")
    write_surely(link, "a = 1\n")
    assert link.is_symlink()
    assert (tmp_path / "real" / "model.toml").read_text("utf-8") == "a = 1\n"
    write_surely(Path(os.devnull), "a = 1\n")
