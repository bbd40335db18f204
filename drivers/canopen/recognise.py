"""Is this the controller that the site file means? Blocking calls for a worker thread."""

import struct
from collections.abc import Mapping

from drivers.canopen import layout as at
from drivers.canopen.device import Device
from drivers.canopen.layout import Layout
from drivers.errors import Refused
from drivers.interface import Identity


def _text(data: bytes) -> str:
    return data.decode("ascii", "replace").rstrip("\0")


def read_identity(controller: Device, layout: Layout) -> Identity:
    """Read 0x1018 and the machine's name; raises Refused if it is another device."""
    vendor, product, _, serial = (
        int.from_bytes(controller.upload(at.IDENTITY, sub), "little") for sub in (1, 2, 3, 4)
    )
    wrong = f"is product 0x{product:X}, expected 0x{layout.product_code:X}"
    if product == layout.product_code:
        machine = _text(controller.upload(at.MACHINE, 1))
        if machine == layout.machine:
            return Identity(
                kind="canopen-controller",
                vendor=f"0x{vendor:08X}",
                product=_text(controller.upload(0x1008, 0)),
                serial=str(serial),
                firmware=_text(controller.upload(0x100A, 0)),
            )
        wrong = f"controls a machine {machine!r}, expected {layout.machine!r}"
    raise Refused(
        wrong,
        device=controller.label,
        remedy="Check node number, machine and EDS file in the site file.",
    )


def check_serial(identity: Identity, serial: str | None, device: str) -> None:
    """Refuse a controller with another serial number than ``serial``."""
    if serial is not None and identity.serial != serial:
        raise Refused(
            f"has serial number {identity.serial}, expected {serial}",
            device=device,
            remedy="Connect the right machine, or correct the site file.",
        )


def check_limits(
    controller: Device, layout: Layout, limits: Mapping[str, tuple[float, float]]
) -> None:
    """Refuse a controller that would let an actuator go further than ``limits`` allow."""
    for sub, name in enumerate(layout.actuators, start=1):
        if name not in limits:
            continue
        low, high = (
            struct.unpack("<d", controller.upload(index, sub))[0]
            for index in (at.LOWER_Q, at.UPPER_Q)
        )
        allowed_low, allowed_high = limits[name]
        if low < allowed_low or high > allowed_high:
            raise Refused(
                f"lets {name} go from {low:g} to {high:g}, the machine file only from "
                f"{allowed_low:g} to {allowed_high:g}",
                device=controller.label,
                remedy="Set the controller's limits, or correct the machine file.",
            )
