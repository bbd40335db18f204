"""Motion controllers that speak PI's General Command Set 2.0, on a serial line or TCP."""

from drivers.gcs.controller import GcsController

__all__ = ["GcsController"]
