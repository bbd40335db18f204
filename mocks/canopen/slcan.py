"""A CAN adapter that speaks slcan (Lawicel ASCII) on TCP.

Every line ends with CR. Commands: ``S0``..``S8`` and ``sXXYY`` set the bit rate, ``O`` and ``L``
open the channel (``L`` listens only), ``C`` closes it, ``V`` and ``N`` answer version and serial
number, ``F`` the status flags, ``t/T/r/R`` send a frame. The adapter answers CR for done and BELL
for refused. Several clients may be connected; they share the bus and hear one another, as several
adapters on one cable do.
"""

import contextlib
import logging
import os
import select
import socket
import struct
import threading
from collections.abc import Callable
from dataclasses import dataclass

logger = logging.getLogger(__name__)

CR, BELL = b"\r", b"\a"
LONGEST_LINE = 64
SEND_DEADLINE_S = 2.0


@dataclass(frozen=True)
class Frame:
    """One CAN frame: identifier, up to eight bytes of data, and its kind."""

    can_id: int
    data: bytes = b""
    extended: bool = False
    remote: bool = False


def encode(frame: Frame) -> bytes:
    """Return the slcan line of ``frame``, CR included."""
    if frame.remote:
        head = f"R{frame.can_id:08X}" if frame.extended else f"r{frame.can_id:03X}"
        return f"{head}{len(frame.data)}\r".encode()
    head = f"T{frame.can_id:08X}" if frame.extended else f"t{frame.can_id:03X}"
    return f"{head}{len(frame.data)}{frame.data.hex().upper()}\r".encode()


def decode(line: bytes) -> Frame:
    """Return the frame of a slcan line without its CR; raises ValueError if it is none."""
    kind, text = chr(line[0]), line.decode("ascii")
    extended, remote = kind in "TR", kind in "rR"
    digits = 8 if extended else 3
    can_id = int(text[1 : 1 + digits], 16)
    length = int(text[1 + digits])
    body = text[2 + digits :]
    if length > 8 or (not extended and can_id > 0x7FF) or can_id > 0x1FFF_FFFF:
        raise ValueError(f"no CAN frame: {text!r}")
    if remote:
        return Frame(can_id, bytes(length), extended, True)
    if len(body) != 2 * length:
        raise ValueError(f"{length} bytes were announced: {text!r}")
    return Frame(can_id, bytes.fromhex(body), extended)


class SlcanClient:
    """One TCP connection: a channel that its client opens and closes."""

    def __init__(self, connection: socket.socket, peer: str) -> None:
        self.connection = connection
        self.peer = peer
        self.is_open = False
        self.listens_only = False
        self.at_work = False
        """Whether what it has sent is being taken in."""
        self._lock = threading.Lock()
        self._closing = threading.Lock()
        self._ended = False
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        connection.settimeout(SEND_DEADLINE_S)

    def send(self, data: bytes) -> None:
        """Send bytes; a client that does not read for two seconds is cut off."""
        try:
            with self._lock:
                self.connection.sendall(data)
        except OSError as error:
            logger.info("slcan client %s is gone: %s", self.peer, error)
            self.close()

    def close(self, reset: bool = False) -> None:
        """End the connection; ``reset`` sends a TCP RST instead of a FIN."""
        self.is_open = False
        with self._closing:
            ended, self._ended = self._ended, True
        if ended:
            return
        with contextlib.suppress(OSError):
            if reset:
                linger = struct.pack("hh" if os.name == "nt" else "ii", 1, 0)
                self.connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
                # Wakes the reader without a FIN; the RST leaves when the last reference closes.
                self.connection.shutdown(socket.SHUT_RD)
            else:
                self.connection.shutdown(socket.SHUT_RDWR)
        with contextlib.suppress(OSError):
            self.connection.close()

    def setting(self, line: bytes) -> bytes:
        """Carry out a command that is not a frame and return the adapter's answer."""
        kind = chr(line[0])
        if kind == "V":
            return b"V1013\r"
        if kind == "N":
            return b"NPKM1\r"
        if kind == "F":
            return b"F00\r" if self.is_open else BELL
        if kind in "OL" and not self.is_open:
            self.is_open, self.listens_only = True, kind == "L"
            return CR
        if kind == "C":
            self.is_open = False
            return CR
        if kind in "Ss" and not self.is_open:
            valid = line[1:].isalnum() and len(line) == (2 if kind == "S" else 5)
            return CR if valid else BELL
        return BELL


class SlcanEndpoint:
    """Listens on TCP and passes frames between its clients and ``receive``.

    Parameters
    ----------
    receive : callable
        Called with each frame that a client sends, in that client's thread.
    host, port
        Where to listen; port 0 takes a free one (see :attr:`address`).
    """

    def __init__(self, receive: Callable[[Frame], None], host: str, port: int) -> None:
        self._receive = receive
        self._clients: list[SlcanClient] = []
        self._lock = threading.Lock()
        self._stopping = False
        self._listener = socket.create_server((host, port))
        self.address: tuple[str, int] = self._listener.getsockname()[:2]
        self._thread = threading.Thread(target=self._accept, name="slcan-accept", daemon=True)

    def start(self) -> None:
        """Begin to accept clients."""
        self._thread.start()

    def stop(self) -> None:
        """Close the listener and every connection."""
        self._stopping = True
        # shutdown wakes accept() on Linux; on Windows closing does.
        with contextlib.suppress(OSError):
            self._listener.shutdown(socket.SHUT_RDWR)
        self._listener.close()
        self.cut()
        self._thread.join(2.0)

    def cut(self, reset: bool = False) -> None:
        """Cut every connection, as a pulled cable (``reset``: as a crashed adapter) would."""
        with self._lock:
            clients, self._clients = self._clients, []
        for client in clients:
            client.close(reset)

    def broadcast(self, frame: Frame, but: SlcanClient | None = None) -> None:
        """Send ``frame`` to every client whose channel is open."""
        line = encode(frame)
        with self._lock:
            clients = [c for c in self._clients if c.is_open and c is not but]
        for client in clients:
            client.send(line)

    @property
    def behind(self) -> bool:
        """Whether a client has sent what is not taken in yet: a busy computer, no silent client."""
        with self._lock:
            clients = list(self._clients)
        if not clients or any(client.at_work for client in clients):
            return bool(clients)
        try:
            return bool(select.select([client.connection for client in clients], [], [], 0)[0])
        except (OSError, ValueError):  # one was closed meanwhile
            return True

    def _accept(self) -> None:
        while not self._stopping:
            try:
                connection, peer = self._listener.accept()
            except OSError:
                return
            client = SlcanClient(connection, f"{peer[0]}:{peer[1]}")
            with self._lock:
                self._clients.append(client)
            threading.Thread(
                target=self._serve, args=(client,), name=f"slcan-{client.peer}", daemon=True
            ).start()

    def _serve(self, client: SlcanClient) -> None:
        pending = b""
        while True:
            try:
                received = client.connection.recv(4096)
            except TimeoutError:
                continue
            except OSError:
                break
            if not received:
                break
            client.at_work = True
            *lines, pending = (pending + received).split(CR)
            if len(pending) > LONGEST_LINE:
                client.send(BELL)
                pending = b""
            for line in lines:
                self._line(client, line)
            client.at_work = False
        client.close()
        with self._lock:
            if client in self._clients:
                self._clients.remove(client)

    def _line(self, client: SlcanClient, line: bytes) -> None:
        if not line:
            client.send(CR)
        elif chr(line[0]) not in "tTrR":
            client.send(client.setting(line))
        elif not client.is_open or client.listens_only:
            client.send(BELL)
        else:
            try:
                frame = decode(line)
            except (ValueError, IndexError):
                client.send(BELL)
                return
            self.broadcast(frame, but=client)
            self._receive(frame)
            client.send(CR)
