"""Noise is physics too: what of it the readings share, how large it is, and readings freed of it.

``component`` names what noise may have, ``scatter`` which readings may scatter otherwise than they
state, ``whitening`` turns readings with such noise into readings with none, ``estimate`` finds the
components that the readings themselves demand.
"""

from calib.noise.component import WHITE, Noise, Taking
from calib.noise.drawn import drawn
from calib.noise.estimate import Component, Found, estimate, points_to_scatter
from calib.noise.scatter import Scatter
from calib.noise.whitening import Whitening

__all__ = [
    "WHITE",
    "Component",
    "Found",
    "Noise",
    "Scatter",
    "Taking",
    "Whitening",
    "drawn",
    "estimate",
    "points_to_scatter",
]
