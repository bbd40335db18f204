"""What the screens send to a terminal of 80 by 24, and how soon a stop is written down.

    python -m bench terminal

Bytes a second while nothing happens, while a mock is measured (its clock runs four times as fast
as the wall's), and on a line of 10 kB a second; then the time from the stop key to the session's
journal on that line, and in a terminal that nobody reads at all.
"""

import fcntl
import json
import os
import pty
import struct
import subprocess
import sys
import tempfile
import termios
import threading
import time
from pathlib import Path

from app.again import command_of
from app.files.site import site_of_mock
from app.session.journal import Journal

LINE_BYTES_PER_S = 10_000
PATIENCE_S = 120.0
STOP, NEW_RUN, CONNECT, GO_ON = b"\x18", b"2n", b"c", b"g"


class Terminal:
    """The program in a terminal; a thread reads it at a rate: None all, 0 nothing."""

    def __init__(self, folder: Path, site: Path) -> None:
        self.pid, self.fd = pty.fork()
        if self.pid == 0:
            os.environ |= {"PKMCAL_STATE": str(folder / "state"), "TERM": "xterm-256color"}
            command = command_of("--site", str(site))
            os.chdir(folder)
            os.execv(command[0], command)
        fcntl.ioctl(self.fd, termios.TIOCSWINSZ, struct.pack("HHHH", 24, 80, 0, 0))
        self.taken = 0
        self.rate: float | None = None
        self._said = b""
        threading.Thread(target=self._read, daemon=True).start()

    def _read(self) -> None:
        while True:
            if self.rate == 0:
                time.sleep(0.01)
                continue
            try:
                data = os.read(self.fd, 65536 if self.rate is None else 200)
            except OSError:
                return
            self.taken += len(data)
            self._said = (self._said + data)[-20_000:]
            if self.rate:
                time.sleep(len(data) / self.rate)

    def press(self, keys: bytes) -> None:
        os.write(self.fd, keys)

    def says(self, words: str) -> bool:
        return words.encode() in self._said

    def per_second(self, seconds: float) -> float:
        before, begun = self.taken, time.monotonic()
        time.sleep(seconds)
        return (self.taken - before) / (time.monotonic() - begun)


def wait(true: object) -> float:
    """Wait until a function says so; seconds that it took."""
    begun = time.monotonic()
    assert callable(true)
    while not true():
        if time.monotonic() - begun > PATIENCE_S:
            raise TimeoutError("it did not come")
        time.sleep(0.002)
    return time.monotonic() - begun


def stop(terminal: Terminal, journal: Journal) -> str:
    """Seconds from the stop key to the journal: that it was asked for, that all stands."""
    before = {word: stops(journal, word) for word in ("stop", "stopped")}
    terminal.press(STOP)
    asked = wait(lambda: stops(journal, "stop") > before["stop"])
    stands = asked + wait(lambda: stops(journal, "stopped") > before["stopped"])
    return f"{asked:8.3f} s, confirmed by both devices {stands:.3f} s"


def stops(journal: Journal, word: str) -> int:
    """How often the session's stop was asked for, or confirmed."""
    return sum(kind == word for _, kind, _ in journal.notes())


def measured(folder: Path, site: Path) -> None:
    """Run the program through its states and print what it sent."""
    terminal = Terminal(folder, site)
    wait(lambda: terminal.says("not connected"))
    time.sleep(2.0)
    terminal.press(CONNECT)
    wait(lambda: terminal.says("firmware"))
    time.sleep(2.0)
    print(f"idle, connected          {terminal.per_second(10.0):8.0f} bytes/s")
    terminal.press(NEW_RUN)
    time.sleep(1.0)
    terminal.press(b"\r")
    found: list[Path] = []
    wait(lambda: found.extend((folder / "sessions").glob("[0-9]*/journal.sqlite")) or found)
    journal = Journal(found[0], read_only=True)
    wait(lambda: journal.readings() > 5)
    print(f"measuring                {terminal.per_second(15.0):8.0f} bytes/s")
    terminal.rate = LINE_BYTES_PER_S
    print(f"measuring, 10 kB/s line  {terminal.per_second(10.0):8.0f} bytes/s")
    print(f"stop to journal there    {stop(terminal, journal)}")
    terminal.rate = None
    time.sleep(2.0)
    terminal.press(GO_ON)
    time.sleep(0.5)
    terminal.press(b"\r")
    count = journal.readings()
    wait(lambda: journal.readings() > count)
    terminal.rate = 0
    time.sleep(10.0)
    count = journal.readings()
    time.sleep(10.0)
    print(f"nobody reads             {(journal.readings() - count) / 10.0:8.1f} readings/s")
    print(f"stop to journal there    {stop(terminal, journal)}")
    journal.close()
    os.close(terminal.fd)
    os.waitpid(terminal.pid, 0)


def main() -> None:
    """Start a mock, run, print."""
    options = ("hexapod", "--seed", "5", "--scale", "4", "--smrs", "3", "--json")
    command = command_of("mock", *options, "--until-stdin-closes")
    with (
        tempfile.TemporaryDirectory() as folder,
        subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as mock,
    ):
        assert mock.stdin is not None
        assert mock.stdout is not None
        site = Path(folder) / "site.toml"
        site.write_text(site_of_mock(json.loads(mock.stdout.readline())).to_toml(), "utf-8")
        measured(Path(folder), site)
        mock.stdin.close()


if __name__ == "__main__":
    sys.exit(main())
