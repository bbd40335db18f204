"""The GCS side of a station: one controller on a pseudo terminal and on TCP."""

import contextlib
import socket
import struct
import threading
from pathlib import Path

from mocks.canopen.ports import Machine
from mocks.gcs.commands import CommandSet
from mocks.gcs.controller import Controller
from mocks.gcs.hexapod_commands import HexapodCommands
from mocks.gcs.hexapod_controller import HexapodController
from mocks.gcs.pseudo_terminal import PseudoTerminal
from mocks.gcs.wire import Commands, Electronics, Wire
from mocks.physics.truth import machine_file, nominal_parameters

TICK_S, LOOK_S = 0.005, 0.1
GARBAGE = bytes(range(0x80, 0xA0)) + b"\n"


class GcsStation:
    """One controller; any number of TCP clients, and one serial line.

    Parameters
    ----------
    world : Machine
        The machine that it moves: three legs, extension 0 at home.
    nvm_path : Path, optional
        File with the stored parameters; None keeps them in memory.
    host, port
        Where it listens on TCP; see :attr:`address`.
    pty : bool
        Whether there is a serial line as well; ignored on Windows.
    serial : int
        Serial number, third field of ``*IDN?``.
    pose : bool
        Whether it is a closed hexapod, which takes poses and keeps nothing, instead of the tripod
        with its parameters.
    """

    def __init__(
        self,
        world: Machine,
        nvm_path: Path | None = None,
        host: str = "127.0.0.1",
        port: int = 0,
        pty: bool = True,
        serial: int = 1001,
        pose: bool = False,
    ) -> None:
        self._faults = world.faults
        self.controller: Electronics
        self._commands: Commands
        nominal = nominal_parameters(machine_file("hexapod" if pose else "tripod"))
        if pose:
            self.controller = hexapod = HexapodController(world, nominal, serial)
            self._commands = HexapodCommands(hexapod)
        else:
            self.controller = tripod = Controller(world, nominal, nvm_path, serial)
            self._commands = CommandSet(tripod)
        self._lock = threading.Lock()
        self._over = threading.Event()
        self._threads: list[threading.Thread] = []
        self._clients: set[socket.socket] = set()
        self._listener = socket.create_server((host, port))
        self._listener.settimeout(LOOK_S)
        self._terminal = _terminal() if pty else None

    @property
    def address(self) -> tuple[str, int]:
        """Host and port on TCP."""
        host, port = self._listener.getsockname()[:2]
        return str(host), int(port)

    @property
    def pty_path(self) -> str:
        """Name of the serial port; empty if there is none."""
        return self._terminal.path if self._terminal is not None else ""

    def start(self) -> None:
        """Power on and accept clients."""
        self._begin(self._watch, "gcs-watch")
        self._begin(self._accept, "gcs-accept")
        if self._terminal is not None:
            self._begin(self._serve_terminal, "gcs-serial")

    def _begin(self, target: object, name: str, *args: object) -> None:
        assert callable(target)
        thread = threading.Thread(target=target, args=args, name=name, daemon=True)
        self._threads.append(thread)
        thread.start()

    def stop(self) -> None:
        """End all threads and connections."""
        self._over.set()
        self.cut()
        for thread in list(self._threads):
            thread.join(2.0)
        self._listener.close()
        if self._terminal is not None:
            self._terminal.close()

    def cut(self, reset: bool = False) -> None:
        """Cut every TCP client off (``reset`` with a TCP RST)."""
        with self._lock:
            clients = list(self._clients)
        for client in clients:
            with contextlib.suppress(OSError):
                if reset:
                    linger = struct.pack("ii", 1, 0)
                    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, linger)
                    client.close()
                else:
                    client.shutdown(socket.SHUT_RDWR)

    def power_cycle(self) -> None:
        """Cut the power and bring it back: volatile memory is lost, the lines stay."""
        with self._lock:
            self.controller.power_on()

    # ------------------------------------------------------------ threads

    def _watch(self) -> None:
        while not self._over.wait(TICK_S):
            with self._lock:
                self.controller.tick()

    def _accept(self) -> None:
        while not self._over.is_set():
            try:
                client, _ = self._listener.accept()
            except TimeoutError:
                continue
            except OSError:
                return
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            client.settimeout(LOOK_S)
            self._clients.add(client)
            self._begin(self._serve_socket, "gcs-client", client)

    def _serve_socket(self, client: socket.socket) -> None:
        wire = Wire(self.controller, self._commands)
        try:
            while not self._over.is_set():
                try:
                    data = client.recv(4096)
                except TimeoutError:
                    continue
                if not data:
                    return
                answer = self._answer(wire, data)
                if answer:
                    client.sendall(answer)
        except OSError:
            return  # the client is gone, or was cut off
        finally:
            self._clients.discard(client)
            client.close()

    def _serve_terminal(self) -> None:
        assert self._terminal is not None
        wire = Wire(self.controller, self._commands)
        while not self._over.is_set():
            data = self._terminal.read(LOOK_S)
            answer = self._answer(wire, data) if data else b""
            if answer:
                self._terminal.write(answer)

    def _answer(self, wire: Wire, data: bytes) -> bytes:
        """Carry out what has come, unless the line is made to misbehave."""
        if "controller-silent" in self._faults:
            return b""
        with self._lock:
            answer = wire.feed(data)
        if answer and "controller-garbage" in self._faults:
            return GARBAGE
        if answer and self._faults.take("controller-half-line"):
            return answer[: len(answer) // 2].rstrip(b"\n")
        return answer


def _terminal() -> PseudoTerminal | None:
    try:
        return PseudoTerminal()
    except OSError:
        return None
