"""The CANopen side of a station: drives and controller on one bus behind an slcan adapter."""

import threading
from functools import partial
from pathlib import Path

from drivers.canopen.eds import drive_eds_path, eds_path
from mocks.canopen.bare_drive import BareDrive
from mocks.canopen.bare_eds import bare_eds_path
from mocks.canopen.bus import EndpointBus, StationNetwork
from mocks.canopen.controller import Controller
from mocks.canopen.drive402 import Drive
from mocks.canopen.node import StationNode
from mocks.canopen.ports import Machine
from mocks.canopen.slcan import Frame, SlcanEndpoint

CONTROLLER_NODE = 10
LONGEST_PAUSE_S, BARE_PAUSE_S, SHORTEST_PAUSE_S = 0.02, 0.004, 0.0005


class CanopenStation:
    """The nodes of one machine on a bus behind ``slcan`` on TCP.

    Parameters
    ----------
    world : Machine
        The machine that they move; its controller's EDS is
        ``drivers/eds/<machine>_controller.eds``.
    nvm_path : Path, optional
        File with the controller's stored parameters; None keeps them in memory.
    host, port
        Where the adapter listens; see :attr:`address`.
    serial : int
        Serial number of the controller (0x1018:4).
    bare : bool
        Whether there are drives alone, as their maker sells them, and no controller.
    eds : Path, optional
        EDS file of the controller, of one's own machine.
    """

    def __init__(
        self,
        world: Machine,
        nvm_path: Path | None = None,
        host: str = "127.0.0.1",
        port: int = 0,
        serial: int = 1001,
        bare: bool = False,
        eds: Path | None = None,
    ) -> None:
        self._world = world
        self._bus = EndpointBus(self._silent)
        self.network = StationNetwork(self._bus)
        numbers = range(1, len(world.legs) + 1)
        drives: list[Drive] = (
            [BareDrive(n, bare_eds_path(world.unit), world) for n in numbers]
            if bare
            else [Drive(n, drive_eds_path(world.kind), world) for n in numbers]
        )
        self.drives = drives
        self.controller = (
            None
            if bare
            else _controller(
                world, drives, nvm_path, serial, eds or eds_path(f"{world.kind}_controller")
            )
        )
        self.nodes: list[StationNode] = [*drives, *([self.controller] if self.controller else [])]
        self.serials = [10 * serial + number for number in numbers]
        for number, drive in enumerate(self.drives, start=1):
            drive.readers[0x1018, 4] = partial(int, self.serials[number - 1])
        self.endpoint = SlcanEndpoint(self._receive, host, port)
        self._bus.endpoint = self.endpoint
        for node in self.nodes:
            node.behind = lambda: self.endpoint.behind
        self._wake = threading.Event()
        self._stopping = False
        self._thread = threading.Thread(target=self._run, name="canopen-station", daemon=True)

    @property
    def address(self) -> tuple[str, int]:
        """Host and port of the adapter."""
        return self.endpoint.address

    def start(self) -> None:
        """Power on: nodes boot, the adapter accepts clients."""
        with self.network.lock:
            for node in self.nodes:
                node.attach(self.network)
            self._power_on()
        self._world.faults.subscribe(self._on_fault)
        self._thread.start()
        self.endpoint.start()

    def stop(self) -> None:
        """End all threads and connections."""
        self._stopping = True
        self._wake.set()
        self._thread.join(2.0)
        self.endpoint.stop()
        for node in self.nodes:
            node.nmt.stop_heartbeat()
        self._bus.shutdown()

    def power_cycle(self) -> None:
        """Cut the power and bring it back: volatile memory is lost, the adapter stays."""
        with self.network.lock:
            self._power_on()

    @property
    def moved_with(self) -> dict[str, int]:
        """How many motions were begun with a set of parameters, by its CRC-32 in hex digits."""
        counts = self.controller.moved_with if self.controller is not None else {}
        return {f"{crc:08x}": count for crc, count in counts.items()}

    @property
    def holds(self) -> str:
        """CRC-32 of the set in use, in hex digits; empty where there is no controller."""
        return f"{self.controller.parameters.checksum():08x}" if self.controller else ""

    def cut(self, reset: bool = False) -> None:
        """Cut every client off the adapter (``reset`` with a TCP RST)."""
        self.endpoint.cut(reset)

    def _power_on(self) -> None:
        for drive in self.drives:
            drive.power_on()
        if self.controller is not None:
            self.controller.power_on()

    def _silent(self, node_id: int) -> bool:
        return str(node_id) in self._world.faults.arguments("heartbeat-silent")

    def _on_fault(self, _name: str, _present: bool) -> None:
        self._wake.set()

    def _receive(self, frame: Frame) -> None:
        self.network.receive(frame)
        if self._wall_time_left() < LONGEST_PAUSE_S:
            self._wake.set()

    def _wall_time_left(self) -> float:
        """Wall seconds after which it is worth while to look again."""
        if self.controller is not None:
            return self.controller.wall_time_left
        return BARE_PAUSE_S if any(leg.moving for leg in self._world.legs) else LONGEST_PAUSE_S

    def _run(self) -> None:
        while not self._stopping:
            with self.network.lock:
                if "power-cycle" in self._world.faults:
                    self._power_on()
                    self._world.faults.take("power-cycle")  # only now: the power is back
                for drive in self.drives:
                    drive.tick()
                if self.controller is not None:
                    self.controller.tick()
                left = self._wall_time_left()
            self._wake.wait(min(max(left, SHORTEST_PAUSE_S), LONGEST_PAUSE_S))
            self._wake.clear()


def _controller(
    world: Machine, drives: list[Drive], nvm_path: Path | None, serial: int, eds: Path
) -> Controller:
    controller = Controller(CONTROLLER_NODE, eds, world, drives, nvm_path)
    controller.readers[0x1018, 4] = lambda: serial
    return controller
