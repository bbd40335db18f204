"""Words for errors and channels."""

import re
from collections.abc import Mapping
from typing import Any

from calib.toml_faults import ManyFaults

_UM = re.compile(r"(?<![\w/.-])um(?![\w/-]|\.\w)")


def said(error: Exception) -> tuple[str, str]:
    """Split an error of ours into what happened and what to do."""
    if isinstance(error, ManyFaults):
        count, *lines = error.what.splitlines()
        return f"{error.place}: {count}", "; ".join(line.strip() for line in lines)
    what = str(getattr(error, "what", "") or error)
    device = str(getattr(error, "device", ""))
    place = str(getattr(error, "place", ""))
    where = device or place
    remedy = str(getattr(error, "remedy", ""))
    return (f"{where}: {what}" if where else what), remedy


def micro(text: str) -> str:
    """Words of the program as the screens show them: ``um`` is micrometres, in no path or name.

    ``+-`` is one sign, too. A terminal that has none gets its own back (:mod:`app.tui.signs`).
    """
    return _UM.sub("µm", text).replace(" +- ", " ± ")


def channel_text(channels: Mapping[str, Any]) -> str:
    """Render a machine's channels: ``structure_temp_C`` becomes ``structure temp 20.13 C``."""
    units = {"C": "C", "kg": "kg", "hPa": "hPa", "s": "s", "mm": "mm"}
    parts = []
    for name, value in channels.items():
        *words, last = name.split("_")
        unit = units.get(last, "")
        label = " ".join(words if unit else [*words, last])
        parts.append(f"{label} {value:.2f} {unit}".rstrip())
    return "   ".join(parts)


def p_text(p: float) -> str:
    """Render a probability in at most five signs: ``5e-81``, ``0.02``, ``1``."""
    return f"{p:.0e}" if p < 0.001 else f"{p:.1g}"
