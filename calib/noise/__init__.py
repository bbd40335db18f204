"""Noise is physics too: what of it the readings share, how large it is, and readings freed of it.

``component`` names what noise may have, ``whitening`` turns readings with such noise into readings
with none, ``estimate`` finds the components that the readings themselves demand.
"""

from calib.noise.component import WHITE, Noise, Taking
from calib.noise.estimate import Component, Found, estimate
from calib.noise.whitening import Whitening

__all__ = ["WHITE", "Component", "Found", "Noise", "Taking", "Whitening", "estimate"]
