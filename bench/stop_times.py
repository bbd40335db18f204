"""How soon a stop is on the wire: from the key to the quick-stop frame, whatever else goes on.

    python -m bench stop_times [--times 3] [--page]

The program's screens run in a terminal and measure on a mock; between it and the CAN adapter stands
a tap that knows the frame of a quick stop (RPDO 1, controlword 0x0002). The key is pressed while
the list of actions is open, while every SDO answer is held back, while the tracker is silent, while
causes are searched for in a run, and in a terminal that nobody reads; then without screens, by
Ctrl-C. Times are of a computer that does other things as well.
"""

import argparse
import contextlib
import json
import os
import re
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from pathlib import Path

import pkmcal
from app.again import command_of
from app.files.pose_table import poses_text
from app.files.site import site_of_mock
from app.session.journal import Journal
from bench._reliability_page import Row, write_row
from bench.kill_resume import POSES
from bench.terminal import CONNECT, NEW_RUN, STOP, Terminal, wait

QUICK_STOP = re.compile(rb"t20[1-6]\d0200")
SDO_ANSWER = re.compile(rb"t5[89][0-9A-F]{18}")
PROMISED_S = 0.2
FINDER, DISCOVER, ESCAPE = b"\x10", b"4d", b"\x1b"


class Tap:
    """Between program and adapter: when a quick stop went by; answers to SDO can be held back."""

    def __init__(self, address: str) -> None:
        host, _, port = address.rpartition(":")
        self._far = (host, int(port))
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"127.0.0.1:{self._listener.getsockname()[1]}"
        self.holds, self.stopped = False, 0.0
        threading.Thread(target=self._listen, daemon=True).start()

    def _listen(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                near.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                far = socket.create_connection(self._far)
                far.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
                for ends in ((near, far, self._out), (far, near, self._back)):
                    threading.Thread(target=self._carry, args=ends, daemon=True).start()

    def _carry(
        self, source: socket.socket, sink: socket.socket, look: Callable[[bytes], bytes]
    ) -> None:
        with contextlib.suppress(OSError):
            while data := source.recv(65536):
                sink.sendall(look(data))
        for end in (source, sink):
            end.close()

    def _out(self, data: bytes) -> bytes:
        if not self.stopped and QUICK_STOP.search(data):
            self.stopped = time.monotonic()
        return data

    def _back(self, data: bytes) -> bytes:
        return SDO_ANSWER.sub(b"", data) if self.holds else data

    def since(self, pressed: float) -> float:
        """Seconds from a key to the frame."""
        wait(lambda: self.stopped)
        return self.stopped - pressed


class Lab:
    """A mock, the tap, and a folder with a run that can be thought about."""

    def __init__(self, folder: Path, said: dict[str, str], tap: Tap) -> None:
        self.folder, self.tap, self._control = folder, tap, said["control"]

    def do(self, **what: object) -> None:
        """Ask the mock's back door."""
        host, _, port = self._control.rpartition(":")
        with socket.create_connection((host, int(port)), timeout=10.0) as link:
            link.sendall(json.dumps(what).encode() + b"\n")
            assert json.loads(link.makefile().readline())["ok"]

    def session(self, known: set[Path], meanwhile: Callable[[], None] = lambda: None) -> Journal:
        """The journal of the session that begins now, some readings on."""
        found: list[Path] = []
        root = self.folder / "sessions"
        wait(lambda: found.extend(set(root.glob("2*/journal.sqlite")) - known) or found)
        journal = Journal(found[0], read_only=True)
        wait(lambda: meanwhile() or journal.readings() > 5)
        return journal

    def known(self) -> set[Path]:
        """Sessions of before."""
        return set((self.folder / "sessions").glob("2*/journal.sqlite"))


def on_screens(lab: Lab, meanwhile: Callable[[Lab, Terminal], None]) -> float:
    """Measure in a terminal, do something else too, and stop."""
    known, terminal = lab.known(), Terminal(lab.folder, lab.folder / "site.toml")
    try:
        wait(lambda: terminal.says("not connected"))
        time.sleep(1.0)
        terminal.press(CONNECT)
        wait(lambda: terminal.says("firmware"))
        _begin(lab, terminal, known)
        lab.session(known, _clearing(terminal)).close()
        meanwhile(lab, terminal)
        lab.tap.stopped = 0.0
        pressed = time.monotonic()
        terminal.press(STOP)
        return lab.tap.since(pressed)
    finally:
        lab.tap.holds = False
        lab.do(do="clear")
        with contextlib.suppress(ProcessLookupError):
            os.kill(terminal.pid, signal.SIGKILL)
        os.waitpid(terminal.pid, 0)
        os.close(terminal.fd)


def _begin(lab: Lab, terminal: Terminal, known: set[Path]) -> None:
    """Ask for a new run until one has begun: a busy computer draws its dialogs late."""
    for _ in range(5):
        terminal.press(NEW_RUN)
        time.sleep(2.0)
        terminal.press(b"\r")
        until = time.monotonic() + 15.0
        while time.monotonic() < until:
            if lab.known() - known:
                return
            time.sleep(0.05)
        terminal.press(ESCAPE)
    raise TimeoutError("no run began")


def _clearing(terminal: Terminal) -> Callable[[], None]:
    """Answers once for the program that was killed in the last state: its drives miss it."""
    answered: list[bool] = []

    def answer() -> None:
        if not answered and terminal.says("stands from before"):
            answered.append(True)
            time.sleep(0.5)
            terminal.press(b"c")

    return answer


def without_screens(lab: Lab) -> float:
    """Measure from the command line, and press Ctrl-C."""
    known = lab.known()
    words = ["measure", "--site", "site.toml", "--poses", "poses.csv", "--unattended"]
    silent = subprocess.DEVNULL
    with subprocess.Popen(
        command_of(*words), cwd=lab.folder, stdout=silent, stderr=silent
    ) as program:
        lab.session(known).close()
        lab.tap.stopped = 0.0
        pressed = time.monotonic()
        program.send_signal(signal.SIGINT)
        return lab.tap.since(pressed)


def _finder(lab: Lab, terminal: Terminal) -> None:
    terminal.press(FINDER)
    time.sleep(1.0)


def _held(lab: Lab, terminal: Terminal) -> None:
    lab.tap.holds = True
    time.sleep(0.4)


def _silent(lab: Lab, terminal: Terminal) -> None:
    lab.do(do="fault", name="tracker-silent")
    time.sleep(0.5)


def _thinking(lab: Lab, terminal: Terminal) -> None:
    terminal.press(DISCOVER)
    time.sleep(1.5)


def _unread(lab: Lab, terminal: Terminal) -> None:
    terminal.rate = 0
    time.sleep(5.0)


WHILE: dict[str, Callable[[Lab, Terminal], None]] = {
    "measuring": lambda lab, terminal: None,
    "the list of actions is open": _finder,
    "SDO answers are held back": _held,
    "the tracker is silent": _silent,
    "causes are searched for": _thinking,
    "nobody reads the terminal": _unread,
}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--times", type=int, default=3)
    parser.add_argument("--page", action="store_true")
    options = parser.parse_args()
    slowest = 0.0
    mock = command_of("mock", "hexapod", "--scale", "20", "--smrs", "3", "--json",
                      "--until-stdin-closes")  # fmt: skip
    with (
        tempfile.TemporaryDirectory() as name,
        subprocess.Popen(mock, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as station,
    ):
        assert station.stdin is not None
        assert station.stdout is not None
        folder, said = Path(name), json.loads(station.stdout.readline())
        tap = Tap(said["can"].removeprefix("socket://"))
        text = site_of_mock(said).to_toml().replace(said["can"], f"socket://{tap.address}")
        (folder / "site.toml").write_text(text, "utf-8")
        (folder / "poses.csv").write_text(poses_text(POSES), "utf-8")
        old = folder / "sessions" / "19990101-000000-hexapod-measure"
        pkmcal.simulate("hexapod", old / "run", poses=60, seed=3)
        os.environ["PKMCAL_STATE"] = str(folder / "state")
        lab = Lab(folder, said, tap)
        every = {what: lambda do=do: on_screens(lab, do) for what, do in WHILE.items()}
        every["without screens, by Ctrl-C"] = lambda: without_screens(lab)
        said_all = []
        for what, measured in every.items():
            times = [measured() for _ in range(options.times)]
            slowest = max(slowest, *times)
            said_all.append(f"{what} {1000.0 * max(times):.0f} ms")
            print(said_all[-1], flush=True)
            if options.page:  # a row that grows: a busy computer may not come to the end
                ran = f"{options.times} stops in each of {len(said_all)} states"
                says = f"at most: {'; '.join(said_all)}"
                write_row("stop", Row(f"stop_times --times {options.times}", ran, says))
        station.stdin.close()
    return 1 if slowest > PROMISED_S else 0


if __name__ == "__main__":
    sys.exit(main())
