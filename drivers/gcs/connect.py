"""Is this the controller that the site file means? Blocking calls for the worker thread."""

from collections.abc import Mapping

from drivers.errors import ConnectFailed, Refused, Silence
from drivers.gcs.answers import numbers
from drivers.gcs.layout import Layout, read_layout
from drivers.gcs.line import Line
from drivers.interface import Identity


def recognise(line: Line, serial: str | None, groups: frozenset[str]) -> tuple[Identity, Layout]:
    """Return who answers and what it holds; raises ConnectFailed, Refused, ProtocolError."""
    identity = greet(line, serial, "gcs-controller")
    return identity, read_layout(line.query("HPA?"), line.device, groups)


def greet(line: Line, serial: str | None, kind: str) -> Identity:
    """Return who answers; raises ConnectFailed, and Refused for another serial number."""
    try:
        line.synchronise()
    except Silence as error:
        raise ConnectFailed(
            f"the port opens, but nobody says who it is ({error.what})",
            device=line.device,
            remedy="Check that the controller is switched on, the cable and the baud rate.",
        ) from error
    vendor, product, number, firmware = (
        field.strip() for field in line.identity.split(",", maxsplit=3)
    )
    identity = Identity(kind, vendor, product, number, firmware)
    if serial is not None and number != serial:
        raise Refused(
            f"has serial number {number}, expected {serial}",
            device=line.device,
            remedy="Connect the right machine, or correct the site file.",
        )
    return identity


def check_limits(line: Line, limits: Mapping[str, tuple[float, float]]) -> None:
    """Refuse a controller that would let an axis go further than ``limits`` (by axis) allow."""
    axes = list(limits)
    low, high = (
        numbers(line.query(f"{what} {' '.join(axes)}"), axes, line.device)
        for what in ("TMN?", "TMX?")
    )
    for axis, lowest, highest in zip(axes, low, high, strict=True):
        allowed_low, allowed_high = limits[axis]
        if lowest < allowed_low or highest > allowed_high:
            raise Refused(
                f"lets axis {axis} go from {lowest:g} to {highest:g}, the machine file only from "
                f"{allowed_low:g} to {allowed_high:g}",
                device=line.device,
                remedy="Set the controller's limits, or correct the machine file.",
            )
