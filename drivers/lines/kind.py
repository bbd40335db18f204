"""The kind ``lines`` of site files."""

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from drivers.errors import DeviceError
from drivers.interface import Tracker
from drivers.kind import Kind, Setting, Surroundings
from drivers.lines.patience import slow_on
from drivers.lines.reading import PLAIN, UNITS, fault_in

if TYPE_CHECKING:
    from drivers.lines.source import Source

_LINKS = ("tcp", "serial", "file")
_FRAMES = tuple(f"{bits}{parity}{stop}" for bits in "78" for parity in "NEO" for stop in "12")


async def open_source(settings: Mapping[str, Any], device: str) -> "Source":
    """Where the lines of a tracker or a gauge come from; raises ConnectFailed."""
    from drivers.lines.source import FileSource, SerialSource, TcpSource

    if settings["link"] == "tcp":
        return await TcpSource.open(settings["source"], device)
    if settings["link"] == "serial":
        return await SerialSource.open(
            settings["source"], settings["baud"], settings["serial_frame"], device
        )
    return await FileSource.open(settings["source"], device)


async def _open(around: Surroundings) -> Tracker:
    from drivers.lines.reading import LinePattern
    from drivers.lines.tracker import LineSettings, LineTracker

    settings = around.settings
    device = f"instrument {settings['source']}"
    source = await open_source(settings, device)
    tracker = LineTracker(
        source,
        LinePattern(
            settings["pattern"] or PLAIN, settings["unit"], settings["decimal"], settings["ignore"]
        ),
        LineSettings(
            settings["sigma_mm"],
            settings["each"] == "sample",
            settings["ask"].encode().decode("unicode_escape"),
            settings["silence_s"],
        ),
        device,
        around.time_scale,
    )
    try:
        await tracker.first_line()
    except DeviceError:
        await tracker.close()
        raise
    return tracker


def address_of(settings: Mapping[str, Any]) -> str:
    """What names an instrument of lines."""
    return f"{settings['link']}:{settings['source']}"


def _no_pattern(text: str) -> str:
    try:
        return slow_on(re.compile(text), anywhere=True) if text else ""
    except re.error as error:
        return f"no pattern: {error}"


LINK = (
    Setting("source", "text", "host:port, a serial port, or the path of a file that grows"),
    Setting("link", "text", "what source is", "tcp", choices=_LINKS),
    Setting("baud", "whole", "of a serial port", 9600, least=50, most=4_000_000),
    Setting(
        "serial_frame",
        "text",
        "of a serial port: bits, parity, stop bits",
        "8N1",
        choices=_FRAMES,
    ),
)
"""Where lines come from, of trackers and of gauges."""
IGNORE = Setting(
    "ignore", "text", "pattern of lines that say nothing: headers, echoes", "", check=_no_pattern
)

KIND: Kind[Tracker] = Kind(
    says="Any instrument or program that sends one reading of a point a line: TCP, serial, a file",
    settings=(
        *LINK,
        Setting("sigma_mm", "number", "standard uncertainty of a reading, mm per axis", least=1e-6),
        Setting(
            "each",
            "text",
            "a line is a sample of a stream, of which a dwell is the mean, or a reading by itself",
            "sample",
            choices=("sample", "reading"),
        ),
        Setting("unit", "text", "of x, y, z in the lines", choices=tuple(UNITS)),
        Setting("decimal", "text", "sign before decimals", ".", choices=(".", ",")),
        Setting(
            "pattern",
            "text",
            "of a whole line, with groups x, y, z (sx, sy, sz); empty: three numbers begin it",
            "",
            check=lambda text: fault_in(text) if text else "",
        ),
        IGNORE,
        Setting("ask", "text", r"what is sent for a reading, as READ?\n; empty: nothing", ""),
        Setting("silence_s", "number", "seconds without a line that are a fault", 5.0, least=0.1),
    ),
    open=_open,
    address=address_of,
)
