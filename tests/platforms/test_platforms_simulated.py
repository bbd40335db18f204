"""What another platform has not: the parts that need no hardware run without it.

A process is started in which modules and signals of POSIX are missing and text goes out in the code
page of a Western Windows; no process, no terminal and no lock of Windows or macOS is in this.
"""

import ast
import os
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
WITHOUT = """
import os, signal, sys
for name in ("fcntl", "grp", "pty", "pwd", "resource", "termios", "tty"):
    sys.modules[name] = None
for name in ("SIGALRM", "SIGHUP", "SIGPROF", "SIGUSR1"):
    delattr(signal, name)
for name in ("fork", "forkpty", "geteuid", "getpgid", "getuid", "killpg", "openpty", "setsid"):
    delattr(os, name)
from app.cli import run
for words in {words!r}:
    code = run(words)
    if code:
        sys.exit(f"{{words}} ended with {{code}}")
"""
JOB = (
    ["machine", "draw", "hexapod"],
    ["machine", "check", "delta"],
    ["mock", "--help"],
    ["simulate", "tripod", "--poses", "8", "--seed", "3", "--out", "run ä"],
    ["poses", "tripod", "--n", "8", "--out", "poses.csv"],
    ["compare", "run ä"],
    ["fit", "run ä", "--save", "model é.toml"],
    ["predict", "model é.toml", "run ä"],
    ["export", "model é.toml", "--as", "toml", "--out", "out.toml"],
    ["correct", "model é.toml", "--pose", "0 0 -140", "--extrapolate"],
    ["sessions"],
)
ONLY_POSIX = {"add_signal_handler", "add_reader", "add_writer", "create_unix_server", "fork"}
"""Names that asyncio's loop of Windows, or Windows itself, has not."""


@pytest.mark.long
def test_the_job_without_hardware_needs_nothing_of_posix_and_speaks_cp1252(tmp_path: Path) -> None:
    code = WITHOUT.format(words=[list(words) for words in JOB])
    around = {
        **os.environ, "PYTHONPATH": str(ROOT), "PYTHONUTF8": "0", "PYTHONIOENCODING": "cp1252",
        "PKMCAL_STATE": str(tmp_path / "state"),
    }  # fmt: skip
    with (tmp_path / "said.txt").open("wb") as said:
        done = subprocess.run(
            [sys.executable, "-c", code], cwd=tmp_path, env=around, stdout=said,
            stderr=subprocess.PIPE, timeout=200, check=False,
        )  # fmt: skip
    assert done.returncode == 0, done.stderr.decode("cp1252")
    assert b"Traceback" not in done.stderr
    assert (tmp_path / "said.txt").read_bytes().decode("cp1252")
    assert (tmp_path / "out.toml").is_file()


def test_nothing_is_called_that_another_platform_has_not() -> None:
    found = [
        f"{file.relative_to(ROOT)}:{node.lineno}"
        for folder in ("app", "calib", "drivers", "mocks", "pkmcal")
        for file in (ROOT / folder).rglob("*.py")
        for node in ast.walk(ast.parse(file.read_text("utf-8")))
        if isinstance(node, ast.Attribute) and node.attr in ONLY_POSIX
    ]
    assert found == []
