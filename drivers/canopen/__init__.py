"""Drives and motion controllers on CANopen (CiA 301, CiA 402)."""

from drivers.canopen.controller import CanopenController

__all__ = ["CanopenController"]
