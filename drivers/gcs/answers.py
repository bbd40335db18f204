"""Taking answers of the form ``A=1.5`` apart."""

import math
from collections.abc import Sequence

from drivers.errors import ProtocolError


def by_item(lines: Sequence[str], device: str) -> dict[str, str]:
    """Return what stands before the equals sign -> what stands behind; raises ProtocolError."""
    found = {}
    for line in lines:
        item, equals, value = line.partition("=")
        if not equals:
            raise _nonsense(line, device)
        found[item.strip()] = value.strip()
    return found


def numbers(lines: Sequence[str], axes: Sequence[str], device: str) -> tuple[float, ...]:
    """Return one finite number an axis, in the order of ``axes``; raises ProtocolError."""
    found = by_item(lines, device)
    try:
        values = tuple(float(found[axis]) for axis in axes)
    except (KeyError, ValueError) as error:
        raise _nonsense(" ".join(lines), device) from error
    if not all(map(math.isfinite, values)):
        raise _nonsense(" ".join(lines), device)
    return values


def registers(lines: Sequence[str], axes: Sequence[str], device: str) -> tuple[int, ...]:
    """Return status register 1 of each axis (``SRG?``); raises ProtocolError."""
    found = by_item(lines, device)
    try:
        return tuple(int(found[f"{axis} 1"], 0) for axis in axes)
    except (KeyError, ValueError) as error:
        raise _nonsense(" ".join(lines), device) from error


def _nonsense(text: str, device: str) -> ProtocolError:
    return ProtocolError(
        f"answers {text[:80]!r}, which makes no sense here",
        device=device,
        remedy="Check the axes in the site file, cable and baud rate.",
    )
