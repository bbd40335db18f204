"""A TCP proxy that spoils what passes: both ways, seeded, each fault counted."""

import contextlib
import random
import select
import socket
import struct
import threading
import time
from collections import Counter

HARMLESS = ("delay", "split", "merge")
"""What a network does every day: nobody may notice."""
ENDING = ("stall", "reset", "drop", "truncate", "duplicate", "corrupt")
"""Few links outlive these: they come seldom, or no session would come far."""
HARM = 0.2
"""How many faults are of the second kind."""
STALL_S = 3.0
HELD_S = 0.05
"""So long what is to go with what follows waits for it: a network holds nothing back for ever."""


class Proxy:
    """Between a program and ``host:port``; from :meth:`spoil` on some of the chunks are spoilt."""

    def __init__(self, address: str, dice: random.Random, harm: float = HARM) -> None:
        host, _, port = address.rpartition(":")
        self._far = (host, int(port))
        self._dice, self._share, self._harm = dice, 0.0, harm
        self.faults: Counter[str] = Counter()
        self._lock = threading.Lock()
        self._open: set[socket.socket] = set()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.address = f"127.0.0.1:{self._listener.getsockname()[1]}"
        threading.Thread(target=self._listen, daemon=True).start()

    def spoil(self, share: float) -> None:
        """From now on this share of what passes is spoilt."""
        self._share = share

    def _listen(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                near, _ = self._listener.accept()
                try:
                    far = socket.create_connection(self._far, timeout=5.0)
                except OSError:
                    near.close()
                    continue
                far.settimeout(None)
                self._open |= {near, far}
                for pair in ((near, far), (far, near)):
                    threading.Thread(target=self._pass, args=pair, daemon=True).start()

    def _pass(self, source: socket.socket, sink: socket.socket) -> None:
        held = b""
        with contextlib.suppress(OSError, ValueError):  # ValueError: closed while it is looked at
            while data := source.recv(4096):
                fault = self._drawn()
                if fault == "merge" and not held and select.select([source], [], [], HELD_S)[0]:
                    held = data
                    continue
                data, held = held + data, b""
                if not self._carried(fault, data, source, sink):
                    break
        for end in (source, sink):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()
            self._open.discard(end)

    def _drawn(self) -> str:
        with self._lock:
            if self._dice.random() >= self._share:
                return ""
            harms = self._dice.random() < self._harm
            fault = self._dice.choice(ENDING if harms else HARMLESS)
            self.faults[fault] += 1
            return fault

    def _carried(self, fault: str, data: bytes, source: socket.socket, sink: socket.socket) -> bool:
        """Pass a chunk on as the fault has it; False where the link is at its end."""
        at = self._dice.randrange(len(data))
        if fault == "delay":
            time.sleep(self._dice.uniform(0.0, 0.3))
        elif fault == "split":
            sink.sendall(data[:at])
            time.sleep(0.002)
            data = data[at:]
        elif fault == "drop":
            return True
        elif fault == "duplicate":
            data += data
        elif fault == "truncate":
            data = data[:at]
        elif fault == "corrupt":
            data = data[:at] + bytes([data[at] ^ (1 << self._dice.randrange(8))]) + data[at + 1 :]
        elif fault == "stall":
            time.sleep(STALL_S)
            return False
        elif fault == "reset":
            linger = struct.pack("ii", 1, 0)
            for end in (source, sink):
                end.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
            return False
        sink.sendall(data)
        return True

    def close(self) -> None:
        """End every connection, and listen no more."""
        self._listener.close()
        for end in tuple(self._open):
            with contextlib.suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
