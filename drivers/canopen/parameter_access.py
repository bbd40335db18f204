"""Reading and writing the controller's parameters: blocking calls for a worker thread."""

import math
import struct
import zlib
from collections.abc import Mapping

from canopen.sdo.exceptions import SdoAbortedError

from drivers.canopen import layout as at
from drivers.canopen.device import Device
from drivers.canopen.layout import Address, Layout
from drivers.canopen.sdo_abort import REMEDIES, abort_words
from drivers.errors import ParameterError, Refused

STORE_DEADLINE_S = 10.0
REMEDY_MISMATCH = "Do not move the machine. Check the EDS file and the controller's firmware."


class ParameterAccess:
    """The parameters of one controller node."""

    def __init__(self, controller: Device, layout: Layout) -> None:
        self._controller = controller
        self._layout = layout
        self._device = controller.label

    def read(self) -> dict[str, float]:
        """Read all parameters as two blocks, each with the CRC-32 over all of them.

        Raises ParameterError if values are missing or not finite, or if the checksum is wrong.
        """
        kinematic, crc_k = self._block(at.KINEMATIC_BLOCK, self._layout.kinematic, "kinematic")
        compensation, crc_c = self._block(
            at.COMPENSATION_BLOCK, self._layout.compensation, "compensation"
        )
        values = kinematic | compensation
        broken = [name for name, value in values.items() if not math.isfinite(value)]
        if broken:
            raise self._error(f"answers {values[broken[0]]} for {', '.join(broken)}")
        here = zlib.crc32(struct.pack(f"<{len(values)}d", *values.values()))
        if not here == crc_k == crc_c:
            raise self._error(
                f"checksum of the parameters is 0x{here:08X} here, "
                f"0x{crc_k:08X} and 0x{crc_c:08X} in the controller"
            )
        return values

    def _block(
        self, index: int, addresses: Mapping[str, Address], what: str
    ) -> tuple[dict[str, float], int]:
        data = self._controller.upload(index, 0)
        count = (len(data) - 4) // 8
        if count != len(addresses) or len(data) % 8 != 4:
            raise self._error(f"answers {count} of {len(addresses)} {what} parameters")
        *numbers, crc = struct.unpack(f"<{count}dI", data)
        return dict(zip(addresses, numbers, strict=True)), crc

    def _error(self, what: str) -> ParameterError:
        return ParameterError(what, device=self._device, remedy=REMEDY_MISMATCH)

    def write(self, values: Mapping[str, float]) -> None:
        """Write each value and read the block back bit for bit.

        Raises ParameterError for an unknown name (before the first is written) and for one that
        reads back otherwise; Refused, naming the parameter, if the controller says no. Those
        written before stay written: the caller restores its snapshot.
        """
        unknown = [name for name in values if name not in self._layout.parameters]
        if unknown:
            raise ParameterError(
                f"does not hold {', '.join(unknown)}",
                device=self._device,
                remedy="Check that the machine file and the EDS file belong together.",
            )
        for name, value in values.items():
            self._write_one(name, value)
        now = self.read()
        wrong = [n for n, v in values.items() if struct.pack("<d", v) != struct.pack("<d", now[n])]
        if wrong:
            raise ParameterError(
                f"reads back other values than were written for {', '.join(wrong)}",
                device=self._device,
                remedy="Restore the snapshot.",
            )

    def _write_one(self, name: str, value: float) -> None:
        index, sub = self._layout.parameters[name]
        try:
            self._controller.download(index, sub, struct.pack("<d", value))
        except SdoAbortedError as error:
            raise Refused(
                f"refuses {name} = {value!r}: {abort_words(error.code)}",
                device=self._device,
                remedy=REMEDIES.get(error.code, "Restore the snapshot."),
                code=error.code,
            ) from error

    def checksum(self) -> int:
        """Read the controller's CRC-32 of the active parameters."""
        data = self._controller.upload(at.CHECKSUM, 1)
        return int.from_bytes(data, "little")

    def command(self, index: int, signature: bytes) -> None:
        """Write a signature to 0x1010, 0x1011 or 0x2501; storing may take seconds."""
        client = self._controller.node.sdo
        usual = client.RESPONSE_TIMEOUT
        client.RESPONSE_TIMEOUT = STORE_DEADLINE_S
        try:
            self._controller.download(index, 1, signature)
        finally:
            client.RESPONSE_TIMEOUT = usual
