"""The screens' colours: calm, high contrast, and never the only carrier of a meaning."""

from textual.app import App
from textual.theme import Theme

BENCH = Theme(
    name="bench",
    primary="#6cb6d9",
    secondary="#93a4b3",
    accent="#e8b45a",
    success="#86c06c",
    warning="#e8b45a",
    error="#f0706a",
    foreground="#dbe2e8",
    background="#0f151b",
    surface="#151d25",
    panel="#1e2933",
    dark=True,
    variables={
        "footer-key-foreground": "#e8b45a",
        "footer-background": "#1e2933",
        "block-cursor-background": "#2f4a5c",
        "block-cursor-foreground": "#ffffff",
        "block-cursor-blurred-background": "#1e2933",
        "block-cursor-text-style": "none",
        "border": "#3a4a58",
        "border-blurred": "#3a4a58",
    },
)

MARKS = {"planned": "·", "started": "▶", "done": "✓", "failed": "✗", "skipped": "–"}
"""A sign for each state of a step, so that no one has to tell colours apart."""

STYLES = {
    "planned": "quiet",
    "started": "bold accent",
    "done": "success",
    "failed": "bold error",
    "skipped": "secondary",
}
"""Style of each state of a step, with a role in place of a colour (:func:`tinted`)."""

LEVELS = {
    "info": (" ", "foreground"),
    "good": ("✓", "success"),
    "warn": ("!", "warning"),
    "bad": ("✗", "bold error"),
}

SERIES = (
    ("o", "primary"),
    ("x", "accent"),
    ("+", "success"),
    ("*", "plum"),
    ("#", "error"),
    ("%", "secondary"),
)
"""Marker and role of each series in a plot."""

BASE = ("·", "secondary")
"""The reference nests on the base."""

FIXED = {"quiet": "#7d8d9a", "plum": "#d78fd0"}
"""Roles that themes do not have; both are seen on dark and on light."""


def tinted(app: App[object], style: str) -> str:
    """A style with the present theme's colours in place of roles: ``bold error``."""
    return " ".join(_colour(app.current_theme, word) for word in style.split())


def _colour(theme: Theme, word: str) -> str:
    if word == "foreground":
        found = theme.foreground or ("#dbe2e8" if theme.dark else "#1b232a")
    elif word in ("primary", "secondary", "accent", "success", "warning", "error"):
        found = getattr(theme, word) or theme.primary
    else:
        found = FIXED.get(word, word)
    return str(found).removeprefix("ansi_")
