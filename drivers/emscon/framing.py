"""From a stream of bytes to packets."""

import struct

from drivers.emscon.wire import HEADER_SIZE
from drivers.errors import ProtocolError

LARGEST_PACKET = 65536


class Framer:
    """Cuts a byte stream into packets, however TCP has split or joined them."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    @property
    def pending(self) -> int:
        """Bytes of an incomplete packet."""
        return len(self._buffer)

    def feed(self, chunk: bytes) -> list[bytes]:
        """Add received bytes; return the packets that are complete. Raises ProtocolError."""
        self._buffer += chunk
        packets = []
        while len(self._buffer) >= HEADER_SIZE:
            size = struct.unpack_from("<i", self._buffer)[0]
            if not HEADER_SIZE <= size <= LARGEST_PACKET:
                raise ProtocolError(
                    f"a packet claims to be {size} bytes long",
                    remedy="Reconnect; check that the address is that of a tracker.",
                )
            if len(self._buffer) < size:
                break
            packets.append(bytes(self._buffer[:size]))
            del self._buffer[:size]
        return packets
