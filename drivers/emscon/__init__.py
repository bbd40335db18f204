"""Laser trackers that speak emScon TPI (AT901 and AT40x generations).

Written from publicly documented interface facts. Not affiliated with the maker; untested on
hardware. ``wire`` and ``codes`` are shared by the driver and by the mock tracker.
"""

from drivers.emscon.tracker import EmsconTracker

__all__ = ["EmsconTracker"]
