"""Spans of time in words."""


def duration(seconds: float) -> str:
    """Render a time span: ``45 s``, ``12 min``, ``2 h 05``."""
    if seconds < 90:
        return f"{seconds:.0f} s"
    minutes = round(seconds / 60)
    return f"{minutes} min" if minutes < 90 else f"{minutes // 60} h {minutes % 60:02d}"
