"""Runs: what a measuring campaign leaves on disk, as arrays (``run.toml`` + ``points.csv``)."""

from calib.runs.header import Header, Load, parse_header
from calib.runs.points import parse_points, parse_run
from calib.runs.record import Run, approach, holdout_folds
from calib.runs.writing import format_run

__all__ = [
    "Header",
    "Load",
    "Run",
    "approach",
    "format_run",
    "holdout_folds",
    "parse_header",
    "parse_points",
    "parse_run",
]
