"""Benches: figures for speed and for statistics that take longer than a test may."""
