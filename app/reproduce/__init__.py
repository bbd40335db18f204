"""Every number of the three papers beside ours: ``pkmcal reproduce``."""
