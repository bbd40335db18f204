"""Machines of a Monte Carlo, in words."""

from collections.abc import Mapping
from typing import Any

from app.show.text_table import text_table

LINES = {
    "position RMS, um": "position_rms_um",
    "position at the worst pose, um": "position_largest_um",
    "orientation RMS, mdeg": "orientation_rms_mdeg",
}


def drawn_words(found: Mapping[str, Any], what: str) -> str:
    """How far off drawn machines are, from the plain data of the answer."""
    rows = [
        [name, *(f"{value:.3g}" for value in found[key].values())] for name, key in LINES.items()
    ]
    table = text_table(["pose error", "median", "95 % below", "largest"], rows)
    lost = f"; {found['not_closing']} cannot take all poses" if found["not_closing"] else ""
    return f"{found['machines']} machines drawn {what}{lost}:\n\n{table}"


def calibrated_words(found: Mapping[str, Any]) -> str:
    """What calibrations of drawn machines leave."""
    return (
        f"{drawn_words(found, 'within their tolerances and calibrated, at fresh poses')}\n\n"
        f"{found['within_1_sigma']:.1%} of the parameters came within one predicted standard "
        "uncertainty (68.3 % are wanted)."
    )
