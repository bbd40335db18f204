"""A mock station for the session's tests, and an ear for its events."""

import json
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from app.files.pose_table import Pose
from app.files.site import Site, site_of_mock
from app.session import events as ev
from mocks.control import ControlClient

SCALE = 400

# Six poses well within reach, far enough apart that moves take time.
POSES: dict[str, Pose] = {
    "a": (5.0, 0.0, 222.0, 0.05, 0.0, 0.1),
    "b": (-6.0, 4.0, 216.0, 0.0, 0.06, -0.1),
    "c": (0.0, -7.0, 224.0, -0.05, 0.03, 0.05),
    "d": (7.0, 6.0, 218.0, 0.03, -0.06, -0.04),
    "e": (-4.0, -4.0, 226.0, 0.02, 0.02, 0.12),
    "f": (2.0, 3.0, 214.0, -0.04, -0.04, 0.0),
}


@dataclass
class Mock:
    """A mock station in a process of its own, its site and its back door."""

    process: "subprocess.Popen[bytes]"
    announcement: Mapping[str, Any]
    hands: ControlClient

    @property
    def site(self) -> Site:
        return site_of_mock(self.announcement)

    def site_file(self, folder: Path) -> Path:
        path = folder / "site.toml"
        path.write_text(self.site.to_toml(), encoding="utf-8")
        return path

    def end(self) -> None:
        self.hands.close()
        assert self.process.stdin is not None
        self.process.stdin.close()
        try:
            self.process.wait(timeout=10.0)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        assert self.process.stdout is not None
        self.process.stdout.close()


def start_mock(*arguments: str, scale: float = SCALE) -> Mock:
    command = [sys.executable, "-m", "mocks.station", "hexapod", "--json", "--until-stdin-closes"]
    process = subprocess.Popen(
        [*command, "--scale", str(scale), *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    assert process.stdout is not None
    announcement = json.loads(process.stdout.readline())
    return Mock(process, announcement, ControlClient(announcement["control"]))


class Heard:
    """Every event of a session, by type."""

    def __init__(self) -> None:
        self.events: list[ev.Event] = []

    def __call__(self, event: ev.Event) -> None:
        self.events.append(event)

    def of(self, kind: type[ev.Event]) -> list[Any]:
        return [event for event in self.events if isinstance(event, kind)]

    def said(self) -> str:
        return "\n".join(str(event) for event in self.events)


def site_text(smrs: int = 1) -> str:
    """A site file of a lab that does not exist."""
    return f"""format = "pkm-site/1"
machine = "hexapod"

[controller]
kind = "canopen"
channel = "socket://127.0.0.1:9"

[tracker]
kind = "emscon"
address = "127.0.0.1:9"
frame = [-900.0, -900.0, -400.0, 0.0, 0.0, 0.3]

[nests.platform]
"3" = [0.0, 100.0, 0.0]
"4" = [-86.60254, -50.0, 0.0]
"5" = [86.60254, -50.0, 0.0]

[nests.base]
b1 = [260.0, 0.0, -30.0]
b2 = [0.0, 260.0, -30.0]
b3 = [-260.0, 0.0, -30.0]
b4 = [0.0, -260.0, -30.0]

[hands]
kind = "operator"
smrs = {smrs}
"""
