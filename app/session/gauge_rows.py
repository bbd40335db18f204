"""Rows of a journal that hold a gauge's number, in ``raw`` under :data:`GAUGE`."""

from app.session.journal import Journal
from app.session.rows import Row

GAUGE = "gauge"


def numbers(journal: Journal) -> list[Row]:
    """Good readings of a gauge, in order."""
    return [row for row in journal.rows() if row.kind == "reading" and GAUGE in row.raw]


def before(journal: Journal) -> list[tuple[float, float]]:
    """What was read so far, and what the drawing expects of each, mm or rad."""
    return [(row.raw[GAUGE]["value"], row.raw[GAUGE]["expected"]) for row in numbers(journal)]


def last_said(journal: Journal) -> str:
    """What the gauge sent for the last of them; empty before the first."""
    rows = numbers(journal)
    return str(rows[-1].raw[GAUGE]["said"]) if rows else ""
