"""Moments of journals (ISO 8601, UTC) by the clock of this computer."""

from datetime import datetime


def clock(utc: str) -> str:
    """A moment with its day: ``2026-11-29 07:14``."""
    return f"{datetime.fromisoformat(utc).astimezone():%Y-%m-%d %H:%M}" if utc else "?"


def time_of_day(utc: str) -> str:
    """A moment of a day, to the second; blanks of the same width where it is not known."""
    return f"{datetime.fromisoformat(utc).astimezone():%H:%M:%S}" if utc else " " * 8


def happening_line(utc: str, kind: str, text: str) -> str:
    """One entry of a session's journal."""
    return f"{time_of_day(utc)}  {kind:8}  {text}"
