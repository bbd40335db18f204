"""The CAN bus inside the mock: a python-can bus whose far side is the slcan endpoint."""

import threading
from collections.abc import Callable

import can
import canopen

from mocks.canopen.slcan import Frame, SlcanEndpoint

SDO_ANSWER, HEARTBEAT = 0x580, 0x700


class EndpointBus(can.BusABC):
    """Frames that our nodes send go out to the adapter's clients.

    A node that :attr:`silent` says is silent is as good as unplugged: nothing of it goes out.
    """

    def __init__(self, silent: Callable[[int], bool]) -> None:
        super().__init__(channel="slcan endpoint")
        self.channel_info = "slcan endpoint"
        self.silent = silent
        self.endpoint: SlcanEndpoint | None = None

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Send to every client."""
        if self.endpoint is None or self.silent(msg.arbitration_id & 0x7F):
            return
        self.endpoint.broadcast(
            Frame(
                msg.arbitration_id, bytes(msg.data), msg.is_extended_id, bool(msg.is_remote_frame)
            )
        )

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        raise NotImplementedError("received frames come through StationNetwork.receive")


class StationNetwork(canopen.Network):
    """All nodes of a station; one lock orders everything that happens to them."""

    def __init__(self, bus: EndpointBus) -> None:
        super().__init__(bus)
        self.lock = threading.RLock()
        self._station_bus = bus

    def receive(self, frame: Frame) -> None:
        """Give a client's frame to the nodes."""
        if frame.remote or frame.extended:
            return
        if self._station_bus.silent(frame.can_id & 0x7F) and frame.can_id & 0x780 != HEARTBEAT:
            return
        with self.lock:
            self.notify(frame.can_id, bytearray(frame.data), 0.0)
