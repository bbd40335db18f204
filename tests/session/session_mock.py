"""A mock station for the session's tests, and an ear for its events."""

import struct
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mock_process import StationProcess

from app.files.pose_table import Pose
from app.files.site import Site, site_of_mock
from app.session import events as ev
from app.session.links import open_controller
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

    process: StationProcess
    hands: ControlClient

    @property
    def site(self) -> Site:
        return site_of_mock(self.process.announcement)

    def site_file(self, folder: Path) -> Path:
        path = folder / "site.toml"
        path.write_text(self.site.to_toml(), encoding="utf-8")
        return path

    def end(self) -> None:
        self.hands.close()
        self.process.end()


def start_mock(*arguments: str, scale: float = SCALE) -> Mock:
    options = ["hexapod", "--json", "--until-stdin-closes", "--scale", str(scale), *arguments]
    process = StationProcess(options)
    return Mock(process, ControlClient(process.announcement["control"]))


async def set_speed(mock: Mock, mm_per_s: float) -> None:
    """Let the legs move this fast from now on: slowly, for what is to happen during a move."""
    controller = await open_controller(mock.site)
    device = controller._bus.controller  # type: ignore[attr-defined]
    await device.call(lambda: device.download(0x2430, 0, struct.pack("<d", mm_per_s)))
    await controller.close()


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
