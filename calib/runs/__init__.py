"""Runs: what a measuring campaign leaves on disk, as arrays (``run.toml`` + ``points.csv``)."""

from calib.runs.covariance import covariance_matrices
from calib.runs.header import Header, Load, parse_header
from calib.runs.points import parse_points, parse_run
from calib.runs.record import Run, holdout_folds
from calib.runs.writing import Digits, format_header, format_points, format_run

__all__ = [
    "Digits",
    "Header",
    "Load",
    "Run",
    "covariance_matrices",
    "format_header",
    "format_points",
    "format_run",
    "holdout_folds",
    "parse_header",
    "parse_points",
    "parse_run",
]
