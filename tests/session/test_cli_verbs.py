"""The command line as a whole: the list of tasks, exit codes, words, one JSON object."""

import asyncio
import contextlib
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from click.testing import CliRunner
from session_mock import POSES, Mock, set_speed, site_text

from app import answer
from app.cli import TASKS, VERBS, pkmcal, run
from app.files.pose_table import poses_text
from app.session.journal import Journal


def cli(*arguments: str, folder: Path) -> "subprocess.CompletedProcess[str]":
    return subprocess.run(
        [sys.executable, "-c", "from app.cli import main; main()", *arguments],
        cwd=folder, env=os.environ, capture_output=True, text=True, timeout=100,
    )  # fmt: skip


def two_poses(folder: Path) -> str:
    path = folder / "poses.csv"
    path.write_text(poses_text({k: POSES[k] for k in "ab"}), encoding="utf-8")
    return str(path)


def test_help_lists_the_tasks_in_working_order_without_importing_them() -> None:
    code = "import sys; from app.cli import run; run(['--help']); print('numpy' in sys.modules)"
    said = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout
    assert said.splitlines()[-1] == "False"
    there = [v for _, verbs in TASKS for v in verbs if (VERBS / f"{v}.py").exists()]
    places = [said.index(f"\n  {verb} ") for verb in there]
    assert places == sorted(places)
    assert {"measure", "resume", "apply", "undo", "verify", "mock"} <= set(there)


@pytest.mark.parametrize("verb", sorted(p.stem.rstrip("_") for p in VERBS.glob("[a-z]*.py")))
def test_every_verb_explains_itself(verb: str) -> None:
    result = CliRunner().invoke(pkmcal, [verb, "--help"])
    assert result.exit_code == 0
    assert "Usage:" in result.output


def test_bad_usage_and_bad_input_end_with_2(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["no-such-verb"]) == 2
    assert run(["measure", "--site", str(tmp_path / "absent"), "--poses", "x"]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert "absent" in said.err
    assert run(["resume", str(tmp_path)]) == 2
    assert "no plan.json" in capsys.readouterr().err


def test_what_does_not_fit_into_the_memory_is_said_in_words(tmp_path, capsys):
    words = ["poses", "hexapod", "--n", "5", "--out", str(tmp_path / "p.toml")]
    assert run([*words, "--candidates", "2000000000000000"]) == 2
    assert "too little memory" in capsys.readouterr().err


def test_a_mistyped_verb_is_answered_with_the_one_meant(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert run(["mesure"]) == 2
    assert "Did you mean measure" in capsys.readouterr().err
    assert run(["qqqqqq"]) == 2
    assert "--help" in capsys.readouterr().err


def test_screens_without_a_terminal_end_with_2_and_a_sentence(tmp_path: Path) -> None:
    said = subprocess.run(
        [sys.executable, "-c", "from app.cli import main; main()"],
        cwd=tmp_path, stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=100,
    )  # fmt: skip
    assert (said.returncode, said.stdout) == (2, "")
    assert "need a terminal" in said.stderr


def test_an_installation_without_any_kind_of_device_is_told_to_be_made_again(
    tmp_path: Path,
) -> None:
    """All packages are there, but what was installed of pkmcal names no entry points."""
    for entry in Path(pytest.__file__).parents[1].iterdir():
        if (
            not entry.name.startswith(
                ("pkmcal", "__editable__", "app", "calib", "drivers", "mocks")
            )
            and entry.suffix != ".pth"
        ):
            (tmp_path / entry.name).symlink_to(entry)
    for name in ("app", "calib", "drivers", "mocks", "pkmcal"):  # without what pip left beside them
        (tmp_path / name).symlink_to(VERBS.parents[1] / name)
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r}); "
        "from app.cli import main; main(['site', 'kinds'])"
    )
    said = subprocess.run(
        [sys.executable, "-S", "-c", code],
        cwd=tmp_path, capture_output=True, text=True, timeout=100,
    )  # fmt: skip
    assert said.returncode == 2, said.stderr
    assert "no kind of controller is installed" in said.stderr
    assert "Install pkmcal again" in said.stderr


def test_nobody_at_the_address_ends_with_3(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    site = tmp_path / "site.toml"
    site.write_text(site_text(), encoding="utf-8")
    arguments = ["measure", "--site", str(site), "--poses", two_poses(tmp_path)]
    assert run([*arguments, "--folder", str(tmp_path), "--json"]) == 3
    said = capsys.readouterr()
    assert said.out == ""
    assert "Check address" in said.err


@pytest.mark.long
def test_an_interrupt_ends_with_4_and_resume_answers_one_json_object(
    mock_of: Callable[..., Mock], tmp_path: Path
) -> None:
    mock = mock_of("--smrs", "3")
    asyncio.run(set_speed(mock, 0.005))
    site = str(mock.site_file(tmp_path))
    command = ["measure", "--site", site, "--poses", two_poses(tmp_path), "--no-warm-up"]
    process = subprocess.Popen(
        [sys.executable, "-c", "from app.cli import main; main()", *command],
        cwd=tmp_path, env=os.environ, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    deadline = time.monotonic() + 60.0
    while not mock.hands("truth")["moving"] and time.monotonic() < deadline:
        time.sleep(0.005)
    process.send_signal(signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert process.returncode == 4, said
    assert "pkmcal resume" in said
    assert not mock.hands("truth")["moving"]
    asyncio.run(set_speed(mock, 20.0))
    again = cli("resume", "--json", folder=tmp_path)
    assert again.returncode == 0, again.stderr
    assert json.loads(again.stdout)["readings"] == 14


@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="no terminal hangs up here")
def test_a_closed_terminal_stops_the_machine_and_leaves_a_journal_to_resume(
    mock_of: Callable[..., Mock], tmp_path: Path
) -> None:
    import pty

    mock = mock_of("--smrs", "3")
    asyncio.run(set_speed(mock, 0.005))
    site = str(mock.site_file(tmp_path))
    command = ["measure", "--site", site, "--poses", two_poses(tmp_path), "--no-warm-up"]
    code = "from app.cli import main; main()"
    child, terminal = pty.fork()
    if child == 0:
        os.chdir(tmp_path)
        os.execv(sys.executable, [sys.executable, "-c", code, *command])
    deadline = time.monotonic() + 60.0
    os.set_blocking(terminal, False)
    seen, answered = b"", False
    while not mock.hands("truth")["moving"]:
        assert time.monotonic() < deadline, seen
        with contextlib.suppress(BlockingIOError):
            seen += os.read(terminal, 65536)
        if b"(clear/stop)" in seen and not answered:  # the mock's drives have missed a PC before
            answered = bool(os.write(terminal, b"clear\n"))
        time.sleep(0.005)
    os.close(terminal)
    _, status = os.waitpid(child, 0)
    code = os.waitstatus_to_exitcode(status)
    (file,) = tmp_path.rglob("journal.sqlite")
    journal = Journal(file, read_only=True)
    faults = [text for _, kind, text in journal.notes() if kind == "fault"]
    journal.close()
    # Where the computer is held up, drives that do not confirm the stop in time are a fault.
    assert code == 4 or (code == 3 and faults), (code, seen, faults)
    assert not mock.hands("truth")["moving"]
    asyncio.run(set_speed(mock, 20.0))
    again = cli("resume", "--json", folder=tmp_path)
    assert again.returncode == 0, again.stderr
    assert json.loads(again.stdout)["readings"] == 14


@pytest.mark.long
@pytest.mark.skipif(not hasattr(signal, "SIGHUP"), reason="no terminal hangs up here")
def test_what_was_begun_with_nohup_goes_on_without_its_terminal(
    mock_of: Callable[..., Mock], tmp_path: Path
) -> None:
    import pty

    mock = mock_of("--smrs", "3")
    site = str(mock.site_file(tmp_path))
    command = ["measure", "--site", site, "--poses", two_poses(tmp_path), "--unattended"]
    code = "from app.cli import main; main()"
    child, terminal = pty.fork()
    if child == 0:
        signal.signal(signal.SIGHUP, signal.SIG_IGN)  # as nohup does
        os.chdir(tmp_path)
        os.execv(sys.executable, [sys.executable, "-c", code, *command, "--no-warm-up"])
    seen = b""
    deadline = time.monotonic() + 60.0
    while b"session" not in seen:
        assert time.monotonic() < deadline, seen
        seen += os.read(terminal, 65536)
    os.close(terminal)
    _, status = os.waitpid(child, 0)
    assert os.waitstatus_to_exitcode(status) == 0
    (run,) = (tmp_path / "sessions").glob("*/run")
    assert len((run / "points.csv").read_text(encoding="utf-8").splitlines()) >= 15


@pytest.mark.long
def test_a_refusing_gate_ends_with_5(mock_of: Callable[..., Mock], tmp_path: Path) -> None:
    site = str(mock_of("--smrs", "3").site_file(tmp_path))
    far = tmp_path / "far.csv"
    far.write_text(poses_text({"far": (25.0, 25.0, 240.0, 0.26, 0.26, 0.35)}), encoding="utf-8")
    refused = cli("measure", "--site", site, "--poses", str(far), folder=tmp_path)
    assert refused.returncode == 5
    assert "pose far" in refused.stderr
    assert "Traceback" not in refused.stderr


def test_numbers_that_json_cannot_say_become_null(capsys: pytest.CaptureFixture[str]) -> None:
    answer.print_json({"a": float("nan"), "b": [1.5, float("inf")], "c": "nan"})
    assert json.loads(capsys.readouterr().out) == {"a": None, "b": [1.5, None], "c": "nan"}


def test_the_mock_tells_how_it_is_used_and_of_its_hands() -> None:
    said = CliRunner().invoke(pkmcal, ["mock", "--help"])
    assert said.exit_code == 0
    assert said.stdout.startswith("Usage: pkmcal mock [OPTIONS] MACHINE\n")
    assert "pkmcal mock do SITE COMMAND" in said.stdout
    assert "--smrs [1|3]" in said.stdout
    assert max(map(len, said.stdout.splitlines())) <= 100
    nothing = CliRunner().invoke(pkmcal, ["mock"])
    assert nothing.exit_code == 2
    assert "Usage" in nothing.stderr
