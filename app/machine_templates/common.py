"""What the templates of machine files have in common."""

import numpy as np

from calib.arrays import Array


def head(name: str, says: str) -> str:
    """The first lines of a machine file."""
    return f"""# {name}: {says}.
# Lengths in mm and angles in rad unless a unit is written: "15 deg" in a table, 15d in a chain.
# pkmcal machine check FILE says what it sees; pkmcal machine draw FILE shows it.
format = "pkm-machine/1"
name = "{name}"
says = "{says}\""""


def parameter(name: str, unit: str, tolerance: str, nominal: str, says: str) -> str:
    """One line of a table of parameters."""
    return (
        f'{name} = {{ unit = "{unit}", tolerance = {tolerance}, nominal = {nominal}, '
        f'says = "{says}" }}'
    )


def join_parts(*parts: str) -> str:
    """Tables of a file, an empty line between them."""
    return "\n\n".join(parts) + "\n"


def on_circle(degrees: float) -> Array:
    """Point (2,) of the unit circle."""
    return np.array([np.cos(np.deg2rad(degrees)), np.sin(np.deg2rad(degrees))])
