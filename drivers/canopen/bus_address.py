"""Where a CAN bus is, and how this PC behaves on it."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any


@dataclass(frozen=True)
class BusAddress:
    """Where the bus is, in python-can's words, and how we behave on it.

    ``heartbeat_s`` is the period of our own heartbeat and of theirs, ``silence_s`` the wall time
    without one after which a partner counts as lost, on either side.
    """

    interface: str
    channel: str
    bitrate: int | None = None
    pc_node: int = 127
    heartbeat_s: float = 0.1
    silence_s: float = 1.0
    more: Mapping[str, Any] = field(default_factory=dict)
    """Further keywords of the interface."""

    def options(self) -> dict[str, Any]:
        """Return the keyword arguments of ``can.Bus``."""
        options: dict[str, Any] = {"interface": self.interface, "channel": self.channel}
        if self.bitrate is not None:
            options["bitrate"] = self.bitrate
        if self.interface == "slcan":
            # A longer read time-out costs no latency (a read ends with its first byte) and keeps
            # an idle bus from waking the processor a thousand times a second.
            options["timeout"] = 0.05
            if self.channel.startswith("socket://"):
                options["sleep_after_open"] = 0
        return {**options, **self.more}
