"""Reading and writing the controller's parameters: blocking calls for the worker thread."""

import math
import struct
import zlib
from collections.abc import Mapping

from drivers.errors import DeviceError, ParameterError, ProtocolError, Refused
from drivers.gcs.answers import by_item
from drivers.gcs.errors import UNKNOWN_PARAMETER
from drivers.gcs.layout import CRC_IN_USE, CRC_STORED, Address, Layout
from drivers.gcs.line import ANSWER_S, Line

STORE_S = 10.0
PAIRS_A_LINE = 16
REMEDY_MISMATCH = "Do not move the machine. Check the controller's parameters and firmware."


class ParameterAccess:
    """The parameters of one controller.

    ``level`` is the command with which writing becomes allowed (``CCL 1 PASSWORD``) and
    ``store_password`` that of WPA.
    """

    def __init__(self, layout: Layout, device: str, level: str, store_password: str) -> None:
        self.layout = layout
        self._device = device
        self._level = level
        self._store_password = store_password

    # ------------------------------------------------------------ reading

    def read(self, line: Line) -> dict[str, float]:
        """Read all kinematic parameters, and compare with the controller's own checksum.

        Raises ParameterError if values are missing or not finite, or the checksum is wrong.
        """
        values = self.values(line, self.layout.parameters)
        missing = [name for name in self.layout.parameters if name not in values]
        if missing:
            count = len(self.layout.parameters)
            what = f"answers {len(values)} of {count} parameters; missing: {', '.join(missing)}"
            raise self._error(what)
        broken = [name for name, value in values.items() if not math.isfinite(value)]
        if broken:
            raise self._error(f"answers {values[broken[0]]} for {', '.join(broken)}")
        here = zlib.crc32(struct.pack(f"<{len(values)}d", *values.values()))
        there = self.checksum(line)
        if here != there:
            raise self._error(
                f"checksum of the parameters is 0x{here:08X} here, 0x{there:08X} in the controller"
            )
        return values

    def values(self, line: Line, addresses: Mapping[str, Address]) -> dict[str, float]:
        """Read those of ``addresses`` that the controller knows, in their order."""
        names = list(addresses)
        found: dict[str, float] = {}
        for first in range(0, len(names), PAIRS_A_LINE):
            chosen = names[first : first + PAIRS_A_LINE]
            try:
                found |= self._read_some(line, {name: addresses[name] for name in chosen})
            except Refused as error:
                if error.code != UNKNOWN_PARAMETER:
                    raise
                found |= self._read_one_by_one(line, {name: addresses[name] for name in chosen})
        return found

    def _read_one_by_one(self, line: Line, addresses: Mapping[str, Address]) -> dict[str, float]:
        """One unknown parameter makes the controller refuse a whole line: ask for each."""
        found: dict[str, float] = {}
        for name, address in addresses.items():
            try:
                found |= self._read_some(line, {name: address})
            except Refused as error:
                if error.code != UNKNOWN_PARAMETER:
                    raise
        return found

    def _read_some(self, line: Line, addresses: Mapping[str, Address]) -> dict[str, float]:
        answered = self._ask(line, list(addresses.values()))
        found = {}
        for name, address in addresses.items():
            if address in answered:
                try:
                    found[name] = float(answered[address])
                except ValueError as error:
                    raise self._error(f"answers {answered[address]!r} for {name}") from error
        return found

    def _ask(self, line: Line, addresses: list[Address]) -> dict[Address, str]:
        words = " ".join(f"{item} 0x{number:X}" for item, number in addresses)
        answer: dict[Address, str] = {}
        for what, value in by_item(line.query(f"SPA? {words}"), self._device).items():
            item, _, number = what.partition(" ")
            try:
                answer[item, int(number, 0)] = value
            except ValueError as error:
                raise self._nonsense(what) from error
        return answer

    def checksum(self, line: Line) -> int:
        """Read the controller's CRC-32 of the parameters in use."""
        return self.whole(line, CRC_IN_USE)

    def whole(self, line: Line, number: int, timeout: float = ANSWER_S) -> int:
        """Read an integer parameter of the controller itself."""
        lines = by_item(line.query(f"SPA? 1 0x{number:X}", timeout), self._device)
        text = next(iter(lines.values()), "")
        try:
            return int(text, 0)
        except ValueError as error:
            raise self._nonsense(text) from error

    # ------------------------------------------------------------ writing

    def write(self, line: Line, values: Mapping[str, float]) -> None:
        """Write each value and read all back bit for bit.

        Raises ParameterError for an unknown name (before the first is written) and for one that
        reads back otherwise; Refused, naming the parameter, if the controller says no. Those
        written before stay written: the caller restores its snapshot.
        """
        unknown = [name for name in values if name not in self.layout.parameters]
        if unknown:
            raise ParameterError(
                f"does not hold {', '.join(unknown)}",
                device=self._device,
                remedy="Check that the machine file and the controller belong together.",
            )
        line.command(self._level)
        try:
            for name, value in values.items():
                self._write_one(line, name, value)
        finally:
            line.command("CCL 0")
        now = self.read(line)
        wrong = [n for n, v in values.items() if struct.pack("<d", v) != struct.pack("<d", now[n])]
        if wrong:
            raise ParameterError(
                f"reads back other values than were written for {', '.join(wrong)}",
                device=self._device,
                remedy="Restore the snapshot.",
            )

    def _write_one(self, line: Line, name: str, value: float) -> None:
        item, number = self.layout.parameters[name]
        try:
            # repr is the shortest text that reads back bit for bit.
            line.command(f"SPA {item} 0x{number:X} {float(value)!r}")
        except Refused as error:
            raise Refused(
                f"{name} = {value!r}: {error.what}",
                device=self._device,
                remedy=error.remedy or "Restore the snapshot.",
                code=error.code,
            ) from error

    def store(self, line: Line) -> None:
        """Keep the parameters in use (WPA) and compare both checksums."""
        line.command(f"WPA {self._store_password}", STORE_S)
        used, stored = self.checksum(line), self.whole(line, CRC_STORED)
        if used != stored:
            raise ParameterError(
                f"has stored other parameters (0x{stored:08X}) than it uses (0x{used:08X})",
                device=self._device,
                remedy="Store again; if it stays so, restore the snapshot.",
            )

    def reload(self, line: Line) -> None:
        """Bring the stored parameters back into use (RPA)."""
        line.command("RPA", STORE_S)

    def _error(self, what: str) -> DeviceError:
        return ParameterError(what, device=self._device, remedy=REMEDY_MISMATCH)

    def _nonsense(self, text: str) -> ProtocolError:
        return ProtocolError(
            f"answers {text!r}, which makes no sense here",
            device=self._device,
            remedy=REMEDY_MISMATCH,
        )
