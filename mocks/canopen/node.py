"""A CANopen node of the station: what every device does, whatever it is.

``canopen.LocalNode`` serves SDO, NMT state and the heartbeat. It neither applies received PDOs nor
sends any, consumes no heartbeat, and keeps no error history; that is here.
"""

import struct
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import canopen
from canopen.objectdictionary import ODVariable
from canopen.sdo.exceptions import SdoAbortedError

from drivers.canopen.eds import dictionary

ABORT_RANGE = 0x0609_0030
ABORT_CANNOT_STORE = 0x0800_0020
ABORT_DEVICE_STATE = 0x0800_0022
SAVE, LOAD = 0x6576_6173, 0x6461_6F6C
OPERATIONAL = "OPERATIONAL"
EMCY_HEARTBEAT = 0x8130
LONGEST_LOOK_S = 0.1
"""Between two looks at a producer's heartbeat; the station looks many times a second."""

Reader = Callable[[], Any]
Writer = Callable[[Any], None]


class StationNode(canopen.LocalNode):
    """A local node with readers and writers by (index, sub-index).

    A writer runs before the value is kept and refuses it by raising ``SdoAbortedError``.
    """

    def __init__(self, node_id: int, eds: Path) -> None:
        super().__init__(node_id, dictionary(eds, node_id))
        self.readers: dict[tuple[int, int], Reader] = {}
        self.writers: dict[tuple[int, int], Writer] = {}
        self.error_register = 0
        self._errors: list[int] = []
        self._heard: float | None = None
        self._looked = time.monotonic()
        self._consumed = 0
        self.behind: Callable[[], bool] = bool
        """Whether frames have come that no node has been given yet."""
        base: Any = self  # the package's own methods carry no types
        base.add_read_callback(self._on_read)
        base.add_write_callback(self._on_write)
        self.readers[0x1001, 0] = lambda: self.error_register
        self.readers[0x1003, 0] = lambda: len(self._errors[:1])
        self.readers[0x1003, 1] = lambda: self._errors[0] if self._errors else 0

    # ------------------------------------------------------------ life

    def boot(self) -> None:
        """Come up: NMT boot-up message, then PRE-OPERATIONAL."""
        self._heard, self._consumed = None, 0
        self.data_store.clear()
        self._errors.clear()
        self.error_register = 0
        self.nmt.state = "INITIALISING"
        self.nmt.state = "PRE-OPERATIONAL"

    def attach(self, network: canopen.Network) -> None:
        """Join the bus and listen to NMT, to the mapped PDOs and to every heartbeat."""
        network.add_node(self)
        network.subscribe(0, self._on_nmt)
        self.tpdo.read(from_od=True)
        self.listen_to_pdos()
        for producer in range(1, 128):
            network.subscribe(0x700 + producer, self._on_heartbeat)

    def listen_to_pdos(self) -> None:
        """Take the RPDOs of the EDS file."""
        self.rpdo.read(from_od=True)
        for pdo in self.rpdo.values():
            pdo.add_callback(self._on_rpdo)

    def _on_nmt(self, _can_id: int, data: bytearray, _timestamp: float) -> None:
        command, node_id = data[0], data[1]
        if node_id in (0, self.id) and command in (129, 130):
            self.reset(application=command == 129)

    def reset(self, application: bool) -> None:
        """NMT reset: of the whole device, or of its communication only."""
        self.boot()

    # ------------------------------------------------------------ dictionary

    def _on_read(self, *, index: int, subindex: int, **_: Any) -> Any:
        reader = self.readers.get((index, subindex))
        return reader() if reader else None

    def _on_write(self, *, index: int, subindex: int, od: Any, data: bytes) -> None:
        writer = self.writers.get((index, subindex))
        if writer:
            writer(od.decode_raw(bytes(data)))

    def value(self, index: int, subindex: int = 0) -> Any:
        """Return the present value of an object."""
        variable = self._variable(index, subindex)
        return variable.decode_raw(self.get_data(index, subindex))

    def _variable(self, index: int, subindex: int) -> ODVariable:
        variable = self.object_dictionary.get_variable(index, subindex)
        if variable is None:
            raise KeyError(f"0x{index:04X}:{subindex} is not in the EDS file of node {self.id}")
        return variable

    def keep(self, index: int, subindex: int, value: Any) -> None:
        """Set an object from inside, without its writer."""
        variable = self._variable(index, subindex)
        self.data_store.setdefault(index, {})[subindex] = variable.encode_raw(value)

    # ------------------------------------------------------------ PDO

    def _on_rpdo(self, pdo: Any) -> None:
        if self.nmt.state != OPERATIONAL:
            return
        offset = 0
        for mapped in pdo.map:
            size = mapped.length // 8
            data = bytes(pdo.data[offset : offset + size])
            offset += size
            try:
                self.set_data(mapped.index, mapped.subindex, data)
            except SdoAbortedError:
                # A PDO has nobody to answer; what the command needs is checked when it comes.
                return

    def send_tpdo(self, number: int) -> None:
        """Send one TPDO now, if the node is OPERATIONAL."""
        if self.nmt.state != OPERATIONAL:
            return
        pdo = self.tpdo[number]
        data = b"".join(self.get_data(v.index, v.subindex) for v in pdo.map)
        self.network.send_message(pdo.cob_id, data)

    # ------------------------------------------------------------ errors

    def emergency(self, code: int, register: int, detail: bytes = b"") -> None:
        """Send EMCY, keep it as last error; code 0 says that the errors are gone."""
        self.error_register = register
        if code:
            self._errors.insert(0, code)
            del self._errors[8:]
        if self.nmt.state != "STOPPED":
            self.emcy.send(code, register, detail)

    # ------------------------------------------------------------ heartbeat of the PC

    def _on_heartbeat(self, can_id: int, _data: bytearray, _timestamp: float) -> None:
        watched = self.value(0x1016, 1)
        if watched and can_id - 0x700 == watched >> 16 & 0x7F:
            self._heard = time.monotonic()
            self._consumed = watched

    @property
    def hears_pc(self) -> bool:
        """Whether the watched producer has been heard since its last silence."""
        return self._heard is not None

    def heartbeat_overdue(self) -> bool:
        """Whether the watched producer was heard once and is silent now; true once a silence."""
        watched = self.value(0x1016, 1)
        now = time.monotonic()
        # A real node is never held up; what this one could not hear meanwhile proves nothing.
        held_up, self._looked = max(now - self._looked - LONGEST_LOOK_S, 0.0), now
        if not watched or watched != self._consumed or self._heard is None:
            return False
        self._heard += held_up
        if now - self._heard <= (watched & 0xFFFF) / 1000.0 or self.behind():
            return False
        self._heard = None
        return True


def check_signature(value: int, signature: int) -> None:
    """Refuse 0x1010 and 0x1011 without their signature (CiA 301: abort 0x08000020)."""
    if value != signature:
        raise SdoAbortedError(ABORT_CANNOT_STORE)


def real64_block(values: list[float], checksum: int) -> bytes:
    """Return values as little-endian REAL64, followed by their CRC-32."""
    return struct.pack(f"<{len(values)}dI", *values, checksum)
