"""Are these the drives that the site file means? Blocking calls for worker threads."""

from pathlib import Path

from canopen.sdo.exceptions import SdoAbortedError

from drivers.canopen.drive402 import CONTROLWORD, MODE, MODE_DISPLAY, STATUSWORD, Drive402
from drivers.canopen.eds import dictionary
from drivers.drives.axis import Axis
from drivers.errors import DeviceError, Refused
from drivers.interface import Identity

DEVICE_TYPE, NAME, FIRMWARE, IDENTITY, MODES = 0x1000, 0x1008, 0x100A, 0x1018, 0x6502
CIA_402 = 402
NEEDED = (
    CONTROLWORD, STATUSWORD, MODE, MODE_DISPLAY, 0x6064, 0x607A, 0x6081, 0x6083, 0x6098, 0x603F,
)  # fmt: skip
REMEDY_EDS = "Name the EDS file of this drive, from its maker, under [controller]."


def check_eds(axis: Axis) -> None:
    """Read an EDS file; raises DeviceError if it is none, or not that of a drive."""
    try:
        objects = dictionary(axis.eds, axis.node)
    except Exception as error:  # the package's reader raises whatever the text leads it to
        raise DeviceError(
            f"{axis.eds} cannot be read as an EDS file: {error}",
            device=f"drive {axis.name}",
            remedy=REMEDY_EDS,
        ) from error
    missing = [index for index in NEEDED if index not in objects]
    if missing:
        raise DeviceError(
            f"{axis.eds.name} has no object 0x{missing[0]:04X}: it is not that of a CiA 402 drive",
            device=f"drive {axis.name}",
            remedy=REMEDY_EDS,
        )


def _number(drive: Drive402, index: int, sub: int = 0) -> int | None:
    try:
        return int.from_bytes(drive.remote.upload(index, sub), "little")
    except SdoAbortedError:
        return None


def _text(drive: Drive402, index: int) -> str:
    try:
        return drive.remote.upload(index).decode("ascii", "replace").rstrip("\0 ")
    except SdoAbortedError:
        return ""


def recognise(drive: Drive402, eds: Path, mode: int) -> Identity:
    """Return who answers; raises Refused if it is no drive, or not the one of its EDS file."""
    kind = _number(drive, DEVICE_TYPE) or 0
    if kind & 0xFFFF != CIA_402:
        raise Refused(
            f"is no CiA 402 drive (0x1000 = 0x{kind:08X})",
            device=drive.device,
            remedy="Check the node numbers under [controller].",
        )
    found = [_number(drive, IDENTITY, sub) for sub in (1, 2)]
    about = drive.remote.node.object_dictionary.device_information
    wanted = [about.vendor_number, about.product_number]
    for what, has, file_has in zip(("vendor", "product"), found, wanted, strict=True):
        if has is not None and file_has and has != file_has:
            raise Refused(
                f"is {what} 0x{has:X}, its EDS file {eds.name} is of {what} 0x{file_has:X}",
                device=drive.device,
                remedy=REMEDY_EDS,
            )
    modes = _number(drive, MODES)
    if modes is not None and not modes >> (mode - 1) & 1:
        raise Refused(
            f"does not offer mode of operation {mode} (0x6502 = 0x{modes:X})",
            device=drive.device,
            remedy="Choose another mode under [controller].",
        )
    serial = _number(drive, IDENTITY, 4)
    return Identity(
        kind="drives",
        vendor="" if found[0] is None else f"0x{found[0]:08X}",
        product=_text(drive, NAME),
        serial="" if serial is None else str(serial),
        firmware=_text(drive, FIRMWARE),
    )


def together(identities: list[Identity]) -> Identity:
    """One identity for all drives: what they share once, the serial numbers one after the other."""

    def join(values: list[str], once: bool) -> str:
        return "-".join(dict.fromkeys(values) if once else values).strip("-")

    return Identity(
        kind="drives",
        vendor=join([one.vendor for one in identities], True),
        product=join([one.product for one in identities], True),
        serial=join([one.serial for one in identities], False),
        firmware=join([one.firmware for one in identities], True),
    )
