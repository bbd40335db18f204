"""The PDO by which a drive takes its controlword, as the drive itself says.

An RPDO that is shorter than its mapping is dropped (CiA 301), so a controlword alone reaches a
drive only if the drive maps nothing else beside it. The mapping is therefore read from the drive,
and what is mapped beside the controlword is sent with the value that the drive has already.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from canopen.sdo.exceptions import SdoAbortedError

from drivers.canopen.device import Device

CONTROLWORD = 0x6040
RPDO_COMMUNICATION, RPDO_MAPPING = 0x1400, 0x1600
MOST_RPDOS = 8
INVALID, EXTENDED = 1 << 31, 1 << 29
LAST_SYNCHRONOUS = 240
DUMMIES = range(1, 8)
"""Indices that stand for a gap: the number is a data type."""

Address = tuple[int, int]


@dataclass(frozen=True)
class Mapped:
    """One object in a PDO; ``size`` in bytes."""

    index: int
    sub: int
    size: int


@dataclass(frozen=True)
class ReceivePdo:
    """An RPDO of a drive: its identifier, whether it waits for SYNC, and what it holds."""

    number: int
    cob_id: int
    synchronous: bool
    holds: tuple[Mapped, ...]

    def has(self, index: int) -> bool:
        """Whether an object is mapped."""
        return any(part.index == index for part in self.holds)

    def frame(self, values: Mapping[Address, bytes]) -> tuple[int, bytes]:
        """Return identifier and data, whole; an address without a value is sent as zeros."""
        parts = (values.get((p.index, p.sub), b"").ljust(p.size, b"\0") for p in self.holds)
        return self.cob_id, b"".join(parts)


def _number(device: Device, index: int, sub: int) -> int:
    return int.from_bytes(device.upload(index, sub), "little")


def read_rpdos(device: Device) -> list[ReceivePdo]:
    """Read the RPDOs that are switched on and can be sent as they stand; blocking."""
    found: list[ReceivePdo] = []
    for number in range(MOST_RPDOS):
        try:
            cob_id = _number(device, RPDO_COMMUNICATION + number, 1)
            kind = _number(device, RPDO_COMMUNICATION + number, 2)
            count = _number(device, RPDO_MAPPING + number, 0)
            words = [_number(device, RPDO_MAPPING + number, sub + 1) for sub in range(count)]
        except SdoAbortedError:
            continue  # drives leave numbers out
        holds = tuple(Mapped(word >> 16, word >> 8 & 0xFF, (word & 0xFF) // 8) for word in words)
        whole = all(word & 0xFF and word & 7 == 0 for word in words)
        if holds and whole and not cob_id & (INVALID | EXTENDED):
            found.append(ReceivePdo(number + 1, cob_id & 0x7FF, kind <= LAST_SYNCHRONOUS, holds))
    return found


def control_pdo(device: Device, told: dict[Address, bytes]) -> ReceivePdo | None:
    """Choose the shortest RPDO that takes the controlword at once; blocking.

    ``told`` is filled with the present values of what is mapped beside it. None if there is no
    such RPDO, or if one of its objects cannot be read: then only SDO is left.
    """
    able = [pdo for pdo in read_rpdos(device) if pdo.has(CONTROLWORD) and not pdo.synchronous]
    for pdo in sorted(able, key=lambda pdo: sum(part.size for part in pdo.holds)):
        values: dict[Address, bytes] = {}
        try:
            for part in pdo.holds:
                if part.index not in (CONTROLWORD, *DUMMIES):
                    values[part.index, part.sub] = device.upload(part.index, part.sub)
        except SdoAbortedError:
            continue
        told.update(values)
        return pdo
    return None
