"""Mock stations in processes of their own, forked where the system can: ready in milliseconds."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import IO, Any

FORKER = Path(__file__).with_name("mock_forker.py")
END_S = 20.0


class StationProcess:
    """A running station and its announcement; it ends with :meth:`end`, or with us."""

    def __init__(self, arguments: list[str]) -> None:
        self._stdin, self._stdout, self._process = (_forked if _can_fork() else _started)(arguments)
        self.announcement: Mapping[str, Any] = json.loads(self._stdout.readline())

    def end(self) -> None:
        """Let the station end with its standard input, or kill it."""
        self._stdin.close()
        deadline = time.monotonic() + END_S
        os.set_blocking(self._stdout.fileno(), False)
        while self._stdout.read() != b"":  # the end of its output is its own
            if time.monotonic() > deadline:
                os.kill(self._process, signal.SIGKILL)
                break
            time.sleep(0.002)
        self._stdout.close()


Started = tuple[IO[bytes], IO[bytes], int]


def _can_fork() -> bool:
    return hasattr(os, "fork")


def _started(arguments: list[str]) -> Started:
    process = subprocess.Popen(
        [sys.executable, "-m", "mocks.station", *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    assert process.stdin is not None
    assert process.stdout is not None
    return process.stdin, process.stdout, process.pid


@cache
def _forker() -> "tuple[socket.socket, subprocess.Popen[bytes]]":
    ours, theirs = socket.socketpair()
    with theirs:
        command = [sys.executable, str(FORKER), str(theirs.fileno())]
        return ours, subprocess.Popen(command, pass_fds=[theirs.fileno()])


def _forked(arguments: list[str]) -> Started:
    asked, _ = _forker()
    their_input, our_output = os.pipe()
    our_input, their_output = os.pipe()
    socket.send_fds(asked, [json.dumps(arguments).encode()], [their_input, their_output])
    os.close(their_input)
    os.close(their_output)
    process = int(asked.recv(100))
    return os.fdopen(our_output, "wb"), os.fdopen(our_input, "rb"), process
