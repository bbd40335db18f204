"""A mock station as a child process that ends with this program."""

import json
import queue
import subprocess
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from app.again import command_of
from drivers.errors import ConnectFailed

START_DEADLINE_S, TURN_DEADLINE_S = 30.0, 360.0
END_DEADLINE_S = 10.0


@contextmanager
def mock_station(
    machine: str, seed: int, scale: float, folder: Path, arguments: Sequence[str] = ()
) -> Iterator[Path]:
    """Start a station with three SMRs; its site file is yielded, the process ends afterwards.

    ``arguments`` are further ones of ``pkmcal mock``.

    Raises
    ------
    ConnectFailed
        If it does not say its addresses within :data:`START_DEADLINE_S`; LinuxCNC may have to
        wait for its turn, :data:`TURN_DEADLINE_S`.
    """
    site, complaints = folder / "site.toml", folder / "station.log"
    command = command_of("mock", machine, "--json", "--until-stdin-closes")
    command += ["--seed", str(seed), "--scale", str(scale), "--smrs", "3"]
    command += ["--site", str(site), "--nvm", str(folder / "controller-memory.json"), *arguments]
    deadline_s = TURN_DEADLINE_S if "--linuxcnc" in arguments else START_DEADLINE_S
    with complaints.open("w", encoding="utf-8") as log:
        station = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=log,
            text=True,
            # Ctrl-C is for this program, which then lets the station end: a station that dies of
            # it as well would look like a fault of the hardware.
            start_new_session=True,
            creationflags=getattr(subprocess, "CREATE_NEW_PROCESS_GROUP", 0),
        )
        try:
            _first_answer(station, complaints, deadline_s)
            yield site
        finally:
            _end(station)


def _first_answer(
    station: subprocess.Popen[str], complaints: Path, deadline_s: float
) -> dict[str, Any]:
    """The line with the addresses; read beside, since a pipe has no deadline of its own."""
    lines: queue.Queue[str] = queue.Queue()

    def read() -> None:
        assert station.stdout is not None
        lines.put(station.stdout.readline())

    threading.Thread(target=read, daemon=True).start()
    try:
        answer: dict[str, Any] = json.loads(lines.get(timeout=deadline_s))
    except (queue.Empty, json.JSONDecodeError):
        said = complaints.read_text(encoding="utf-8").strip().splitlines()
        raise ConnectFailed(
            f"the mock station did not start: {said[-1] if said else 'it said nothing'}",
            device="mock station",
            remedy=f"See {complaints}.",
        ) from None
    return answer


def _end(station: subprocess.Popen[str]) -> None:
    assert station.stdin is not None
    assert station.stdout is not None
    station.stdin.close()
    try:
        station.wait(timeout=END_DEADLINE_S)
    except subprocess.TimeoutExpired:
        station.kill()
        station.wait()
    station.stdout.close()
