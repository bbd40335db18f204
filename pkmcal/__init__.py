"""Calibrate parallel-kinematic machines."""
