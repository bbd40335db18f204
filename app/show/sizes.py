"""What was found for an unknown, in words."""

from collections.abc import Mapping
from typing import Any

from calib.digits import plus_minus


def size_text(parameter: Mapping[str, Any], sign: str = "+-") -> str:
    """An entry of ``parameters``: ``0.012 +- 0.001 mm``, ``896 +- 13 s (the start of run 2)``.

    A number that stands for one of a few things is its name: ``the base``.
    """
    means = parameter.get("means", "")
    if means and parameter["unit"] == "1":
        return str(means)
    told = plus_minus(parameter["value"], parameter["sigma"], parameter["unit"], sign=sign)
    return f"{told} ({means})" if means else told
