"""Between python-can's reading thread and the nodes: nothing that arrives ends that thread."""

import logging
import time
from collections import deque
from collections.abc import Callable

import can
from canopen.network import MessageListener, Network

MOST_DAMAGED, WITHIN_S = 50, 5.0
"""More damaged frames than these in such a time are a line that cannot be worked with."""
TOLD_EVERY_S = 1.0
REST_S = 0.1

for _library in ("can", "canopen"):
    # What they log is ours to tell, in words; without a handler it goes to the terminal.
    logging.getLogger(_library).addHandler(logging.NullHandler())


class FrameReader(MessageListener):
    """Feeds frames to a network; counts those that are damaged.

    Parameters
    ----------
    network
        Whose subscribers hear of each frame.
    on_damaged : function of (int, str)
        How many have been dropped so far, and what the last was; at most once a second.
    on_gone : function of str
        Why nothing sensible arrives any more; the reading thread goes on until the bus is closed.
    """

    def __init__(
        self,
        network: Network,
        on_damaged: Callable[[int, str], None],
        on_gone: Callable[[str], None],
    ) -> None:
        super().__init__(network)
        self.damaged = 0
        self._on_damaged, self._on_gone = on_damaged, on_gone
        self._times: deque[float] = deque(maxlen=MOST_DAMAGED)
        self._told = -TOLD_EVERY_S

    def on_message_received(self, msg: can.Message) -> None:
        """Pass a frame on; one that a subscriber cannot read is damaged."""
        if msg.is_error_frame or msg.is_remote_frame:
            return
        try:
            self.network.notify(msg.arbitration_id, msg.data, msg.timestamp)
        except Exception as error:  # whatever a subscriber makes of bytes that are not as expected
            self.note(f"a frame 0x{msg.arbitration_id:X} of {len(msg.data)} bytes ({error})")

    def on_error(self, exc: Exception) -> None:
        """Tell a link that is gone from a frame that the interface could not read."""
        if isinstance(exc, (can.CanError, OSError)):
            self._on_gone(str(exc))
            time.sleep(REST_S)  # the thread asks again at once, until the bus is closed
            return
        self.note(f"something that the interface cannot read ({type(exc).__name__}: {exc})")
        if self.network.notifier is not None:
            self.network.notifier.exception = None

    def note(self, what: str) -> None:
        """Count something damaged."""
        now = time.monotonic()
        self.damaged += 1
        self._times.append(now)
        if len(self._times) == MOST_DAMAGED and now - self._times[0] < WITHIN_S:
            since = now - self._times[0]
            self._on_gone(f"{MOST_DAMAGED} damaged frames within {since:.1f} s; the last: {what}")
        elif now - self._told >= TOLD_EVERY_S:
            self._told = now
            self._on_damaged(self.damaged, what)

    def stop(self) -> None:
        """Nothing is held."""
