"""A terminal that nobody reads holds up nothing but the picture."""

import fcntl
import json
import os
import pty
import re
import signal
import struct
import subprocess
import sys
import termios
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from app.again import command_of
from app.files.site import site_of_mock
from app.session.journal import Journal

PROGRAM = "import sys; from app.cli import main; sys.exit(main())"
PATIENCE_S = 90.0
SEQUENCE = re.compile(r"\x1b\[[0-9;?<>=$]*[A-Za-z]")


class Terminal:
    """The program in a terminal of 80 by 24, that is read only when told."""

    def __init__(self, folder: Path, *arguments: str) -> None:
        self.pid, self.fd = pty.fork()
        if self.pid == 0:
            os.chdir(folder)
            os.environ |= {
                "PKMCAL_STATE": str(folder / "state"), "TERM": "xterm-256color",
                "PYTHONPATH": os.pathsep.join(sys.path),
            }  # fmt: skip
            os.execv(sys.executable, [sys.executable, "-c", PROGRAM, *arguments])
        fcntl.ioctl(self.fd, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        os.set_blocking(self.fd, False)
        self.said = ""

    def press(self, *keys: str) -> None:
        for key in keys:
            os.write(self.fd, key.encode())

    def read(self) -> None:
        try:
            while data := os.read(self.fd, 65536):
                self.said += data.decode(errors="replace")
        except BlockingIOError:
            pass
        except OSError:  # the program has ended
            pass

    def until_it_says(self, words: str) -> None:
        """Wait for words that are new on the screen: what stood there already is not sent."""

        def said() -> bool:
            self.read()
            return words in SEQUENCE.sub("", self.said)

        wait(said, f"it never says {words!r}")

    @property
    def unread(self) -> int:
        return int.from_bytes(fcntl.ioctl(self.fd, termios.FIONREAD, b"\0" * 4), sys.byteorder)

    def end(self) -> None:
        """Close the terminal (SIGHUP): it stops the machine and ends, or is ended."""
        os.close(self.fd)
        deadline = time.monotonic() + PATIENCE_S
        while os.waitpid(self.pid, os.WNOHANG) == (0, 0):
            if time.monotonic() > deadline:
                os.kill(self.pid, signal.SIGKILL)
                os.waitpid(self.pid, 0)
                pytest.fail("it does not end with its terminal")
            time.sleep(0.02)


def wait(true: Callable[[], object], else_says: str = "it did not come") -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not true():
        assert time.monotonic() < deadline, else_says
        time.sleep(0.02)


@pytest.fixture
def site(tmp_path: Path) -> Iterator[Path]:
    """A mock's site file; the mock ends with its standard input."""
    options = ("hexapod", "--seed", "5", "--scale", "100", "--smrs", "3", "--json")
    command = command_of("mock", *options, "--until-stdin-closes")
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as mock:
        assert mock.stdin is not None
        assert mock.stdout is not None
        path = tmp_path / "site.toml"
        path.write_text(site_of_mock(json.loads(mock.stdout.readline())).to_toml())
        yield path
        mock.stdin.close()


@pytest.fixture
def terminal(tmp_path: Path, site: Path) -> Iterator[Terminal]:
    shown = Terminal(tmp_path, "--site", str(site))
    yield shown
    shown.end()


def test_measuring_goes_on_and_a_stop_is_heard_while_nobody_reads(
    terminal: Terminal, tmp_path: Path
) -> None:
    terminal.until_it_says("not connected")
    terminal.press("c")
    terminal.until_it_says("firmware")
    terminal.press("2", "n")
    terminal.until_it_says("New run")
    terminal.press("\r")
    wait(lambda: list((tmp_path / "sessions").glob("[0-9]*/journal.sqlite")))
    (path,) = (tmp_path / "sessions").glob("[0-9]*/journal.sqlite")
    with_journal = Journal(path, read_only=True)

    # From here on nobody reads; what the terminal takes without a reader fills up.
    full = 0

    def filled() -> bool:
        nonlocal full
        before, full = full, terminal.unread
        time.sleep(0.5)
        return full >= 3500 and full == before

    wait(filled)
    read = with_journal.readings()
    wait(lambda: with_journal.readings() >= read + 12)
    assert terminal.unread == full
    terminal.press("\x18")
    wait(lambda: any(kind == "stopped" for _, kind, _ in with_journal.notes()))
    kinds = [kind for _, kind, _ in with_journal.notes()]
    assert kinds.index("stop") < kinds.index("stopped")
    assert terminal.unread == full
    with_journal.close()

    terminal.said = ""
    terminal.until_it_says("stopped")
