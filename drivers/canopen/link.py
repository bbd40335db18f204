"""One CAN bus: SDO calls in worker threads, our heartbeat, theirs, and the end of the link.

The ``canopen`` package blocks, and two threads on one node mix up their answers, so every SDO
access runs in a worker thread under a lock of its node. Its callbacks run in the receiving thread,
where no SDO call is possible; they are handed to the event loop.
"""

import asyncio
import contextlib
import logging
import socket
import struct
import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, TypeVar

import can
import canopen
from canopen.emcy import EmcyError
from canopen.sdo.exceptions import SdoAbortedError, SdoCommunicationError

from drivers.canopen.bus_address import BusAddress
from drivers.canopen.device import Device
from drivers.canopen.eds import dictionary
from drivers.canopen.reader import FrameReader
from drivers.canopen.sdo_abort import REMEDIES, UNUSUAL, abort_words
from drivers.canopen.slcan_bus import open_bus
from drivers.errors import (
    ConnectFailed,
    DeviceError,
    DeviceFault,
    HeartbeatLost,
    LinkLost,
    ProtocolError,
    Refused,
    Silence,
)

logger = logging.getLogger(__name__)
T = TypeVar("T")

WATCH_PERIOD_S = 0.05
BOOT_UP = 0
SDO_DEADLINE_S = 1.0
NO_LIBRARY = (can.CanInterfaceNotImplementedError, ImportError, NameError)
UNKNOWN_WORDS = (TypeError, ValueError, struct.error)
REMEDY_LINK = "Check cable, adapter and power; then connect again. The machine stops by itself."


class CanLink:
    """An open bus with its nodes. Use :meth:`open`.

    Faults that stand (:attr:`faults`, by key) are latched until :meth:`clear_faults`; ``on_fault``
    is called in the event loop for each new one, ``on_emergency`` for every EMCY, ``on_damaged``
    at times with the number of damaged frames that were ignored and what the last one was.
    """

    def __init__(self, address: BusAddress) -> None:
        self.address = address
        self.name = f"CAN {address.interface} {address.channel}"
        self.faults: dict[str, DeviceError] = {}
        self.on_fault: Callable[[DeviceError], None] = lambda _: None
        self.on_emergency: Callable[[int, int, int], None] = lambda *_: None
        self.on_damaged: Callable[[int, str], None] = lambda *_: None
        self.closed = False
        self._network = canopen.Network()
        self.reader = FrameReader(self._network, self._damaged, self._gone)
        self._network.listeners = [self.reader]
        self._locks: dict[int, threading.Lock] = {}
        self._labels: dict[int, str] = {}
        self._heard: dict[int, float] = {}
        self._loop = asyncio.get_running_loop()
        self._workers = ThreadPoolExecutor(8, thread_name_prefix="canopen")
        self._watcher = threading.Thread(target=self._watch, name="canopen-watch", daemon=True)
        self._end = threading.Event()

    @classmethod
    async def open(cls, address: BusAddress, timeout: float = 5.0) -> "CanLink":
        """Open the bus and begin to send our heartbeat; raises ConnectFailed."""
        link = cls(address)
        remedy = "Check address, power and cable of the CAN adapter."
        connecting = link._loop.run_in_executor(link._workers, link._open_bus)
        try:
            await asyncio.wait_for(connecting, timeout)
        except TimeoutError as error:
            link.closed = True
            what = f"did not open within {timeout} s"
            raise ConnectFailed(what, device=link.name, remedy=remedy) from error
        except Exception as error:  # python-can's interfaces raise whatever their libraries do
            link._workers.shutdown(wait=False)
            if isinstance(error, UNKNOWN_WORDS):
                remedy = "Check [controller.can] against python-can's page of this interface."
            elif isinstance(error, NO_LIBRARY) or "library not found" in str(error):
                remedy = "Install the maker's driver and library, or choose another interface."
            raise ConnectFailed(str(error), device=link.name, remedy=remedy) from error
        link._watcher.start()
        return link

    def _open_bus(self) -> None:
        self._network.bus = open_bus(self.address.options(), self.reader.note)
        self._network.connect()
        if self.closed:  # too late: nobody waits any more
            self._disconnect()
            return
        connection = self._connection()
        if connection is not None:
            # Frames are short and must not wait for one another's acknowledgement.
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def _connection(self) -> socket.socket | None:
        """The socket of an adapter on TCP, which python-can and pyserial keep to themselves."""
        port = getattr(self._network.bus, "serialPortOrig", None)
        connection = getattr(port, "_socket", None)
        return connection if isinstance(connection, socket.socket) else None

    def add_device(self, node_id: int, eds: Path, label: str, pdos: bool = True) -> "Device":
        """Add a remote node; ``label`` is what errors call it.

        ``pdos``: whether its PDOs are as its EDS file says.
        """
        node = self._network.add_node(node_id, dictionary(eds, node_id))
        node.sdo.RESPONSE_TIMEOUT = SDO_DEADLINE_S
        if pdos:
            node.tpdo.read(from_od=True)
            node.rpdo.read(from_od=True)
        self._locks[node_id] = threading.Lock()
        self._labels[node_id] = label
        node.nmt.add_heartbeat_callback(lambda state: self._hear(node_id, state))
        node.emcy.add_callback(lambda emcy: self._hear_emergency(node_id, emcy))
        return Device(self, node_id, label, node)

    def label(self, node_id: int) -> str:
        """Return what a node is called."""
        return self._labels.get(node_id, f"node {node_id}")

    # ------------------------------------------------------------ calls

    async def call(self, node_id: int, action: Callable[[], T]) -> T:
        """Run blocking ``action`` on a node in a worker thread.

        Raises Refused (SDO abort, with code), Silence (no answer), ProtocolError (an answer of
        another size than the EDS file says) or LinkLost.
        """
        self._must_be_open()
        return await self._loop.run_in_executor(self._workers, self._locked, node_id, action)

    def _must_be_open(self) -> None:
        if self.closed:
            raise LinkLost("the link is closed", device=self.name, remedy="Connect again.")

    def _locked(self, node_id: int, action: Callable[[], T]) -> T:
        with self._locks[node_id]:
            try:
                return action()
            except SdoAbortedError as error:
                raise Refused(
                    abort_words(error.code),
                    device=self.label(node_id),
                    remedy=REMEDIES.get(error.code, UNUSUAL),
                    code=error.code,
                ) from error
            except SdoCommunicationError as error:
                raise self._unanswered(node_id, error) from error
            except (struct.error, canopen.ObjectDictionaryError) as error:
                raise ProtocolError(
                    f"an answer of another size than the object has ({error})",
                    device=self.label(node_id),
                    remedy="Check that the EDS file is this device's, then the adapter's cable.",
                ) from error
            except (can.CanError, OSError, RuntimeError) as error:
                raise self._lost(error) from error

    def _unanswered(self, node_id: int, error: Exception) -> DeviceError:
        lost = self.faults.get("link") or self.faults.get(f"heartbeat {node_id}")
        if lost is not None:
            return lost
        if self._receiver_failed():
            return self._lost(error)
        return Silence(
            f"no answer within {SDO_DEADLINE_S} s ({error})",
            device=self.label(node_id),
            remedy="Check that the device is switched on.",
        )

    def _lost(self, error: BaseException | str) -> LinkLost:
        return LinkLost(f"the link is gone ({error})", device=self.name, remedy=REMEDY_LINK)

    def _gone(self, why: str) -> None:
        self.latch("link", self._lost(why))

    def _damaged(self, count: int, what: str) -> None:
        self.in_loop(self.on_damaged, count, what)

    def _receiver_failed(self) -> BaseException | None:
        notifier = self._network.notifier
        return notifier.exception if notifier is not None else None

    async def send(self, frames: list[tuple[int, bytes]]) -> None:
        """Send frames (COB-ID, data) in this order; raises LinkLost."""
        self._must_be_open()
        await self._loop.run_in_executor(self._workers, self.send_now, frames)

    def send_now(self, frames: list[tuple[int, bytes]]) -> None:
        """As :meth:`send`, from any thread; blocking."""
        try:
            for cob_id, data in frames:
                self._network.send_message(cob_id, data)
        except (can.CanError, OSError, RuntimeError) as error:
            raise self._lost(error) from error

    def in_loop(self, function: Callable[..., None], *arguments: Any) -> None:
        """Call ``function`` in the event loop, from any thread."""
        # A callback may still come while the loop closes.
        with contextlib.suppress(RuntimeError):
            self._loop.call_soon_threadsafe(function, *arguments)

    # ------------------------------------------------------------ watching

    def heard_since(self, node_id: int, moment: float) -> bool:
        """Whether a node's heartbeat came after ``moment`` (time.monotonic)."""
        return self._heard.get(node_id, -1.0) > moment

    def _hear(self, node_id: int, state: int) -> None:
        if state == BOOT_UP:
            self.latch(
                f"restart {node_id}",
                DeviceFault(
                    "was switched off and on: what was not stored is lost",
                    device=self.label(node_id),
                    remedy="Clear the faults, compare the parameters and enable the machine again.",
                ),
            )
        self._heard[node_id] = time.monotonic()

    def _hear_emergency(self, node_id: int, emcy: EmcyError) -> None:
        self.in_loop(self.on_emergency, node_id, emcy.code, emcy.register)

    def _watch(self) -> None:
        """Send our heartbeat, and notice lost nodes and the end of the link."""
        last_sent, last_look = 0.0, time.monotonic()
        while not self._end.wait(WATCH_PERIOD_S):
            now = time.monotonic()
            if now - last_look > 4 * WATCH_PERIOD_S:
                # This process itself was held up: what it did not hear meanwhile proves nothing.
                self._heard = {node: at + now - last_look for node, at in self._heard.items()}
            last_look = now
            if "link" in self.faults:
                return  # without our heartbeat the nodes stop, whatever they still hear
            failure = self._receiver_failed()
            if failure is None and now - last_sent >= self.address.heartbeat_s - 0.01:
                last_sent = now
                failure = self._send_heartbeat()
            if failure is not None:
                self.latch("link", self._lost(failure))
                return
            for node_id, heard in list(self._heard.items()):
                if now - heard > self.address.silence_s:
                    self._lose(node_id)

    def _send_heartbeat(self) -> Exception | None:
        try:
            self._network.send_message(0x700 + self.address.pc_node, b"\x05")
        except (can.CanError, OSError, RuntimeError) as error:
            return error
        return None

    def _lose(self, node_id: int) -> None:
        self._heard.pop(node_id, None)
        self.latch(
            f"heartbeat {node_id}",
            HeartbeatLost(
                f"no heartbeat for {self.address.silence_s} s",
                device=self.label(node_id),
                remedy="The machine has been told to stop. Check power and cable of the device.",
            ),
        )

    def latch(self, key: str, fault: DeviceError) -> None:
        """Let ``fault`` stand and tell of it once; from any thread."""
        if key not in self.faults and not self.closed:
            self.faults[key] = fault
            self.in_loop(self.on_fault, fault)

    def unlatch(self, key: str) -> None:
        """Forget one standing fault."""
        self.faults.pop(key, None)

    def clear_faults(self) -> None:
        """Forget the standing faults, except that the link is gone."""
        self.faults = {key: fault for key, fault in self.faults.items() if key == "link"}

    def check(self) -> None:
        """Raise the fault that is standing, the link's own first."""
        fault = self.faults.get("link") or next(iter(self.faults.values()), None)
        if fault is not None:
            raise fault

    # ------------------------------------------------------------ NMT and the end

    async def send_heartbeat(self) -> None:
        """Send our heartbeat once more than the watcher does; raises LinkLost."""
        await self.send([(0x700 + self.address.pc_node, b"\x05")])

    async def operational(self) -> None:
        """Set all nodes OPERATIONAL."""
        await self.send([(0, bytes([1, node_id])) for node_id in self._locks])

    async def close(self) -> None:
        """Release the bus; never raises."""
        if self.closed:
            return
        self.closed = True
        self._end.set()
        try:
            closing = self._loop.run_in_executor(self._workers, self._disconnect)
            await asyncio.wait_for(closing, 3.0)
        except Exception as error:  # the network raises again what ended its reader
            logger.info("%s: closing: %s", self.name, error)
        self._workers.shutdown(wait=False)

    def _disconnect(self) -> None:
        if self._watcher.is_alive():
            self._watcher.join(1.0)
        connection = self._connection()
        try:
            self._network.disconnect()
        finally:
            # On a broken line neither slcan's shutdown nor pyserial's close gets as far as this.
            if connection is not None:
                connection.close()
