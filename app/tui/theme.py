"""The screens' colours: calm, high contrast, and never the only carrier of a meaning."""

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
    "planned": "#7d8d9a",
    "started": "bold #e8b45a",
    "done": "#86c06c",
    "failed": "bold #f0706a",
    "skipped": "#93a4b3",
}

LEVELS = {
    "info": (" ", "#dbe2e8"),
    "good": ("✓", "#86c06c"),
    "warn": ("!", "#e8b45a"),
    "bad": ("✗", "bold #f0706a"),
}

SERIES = (
    ("o", "#6cb6d9"),
    ("x", "#e8b45a"),
    ("+", "#86c06c"),
    ("*", "#d78fd0"),
    ("#", "#f0706a"),
    ("%", "#93a4b3"),
)
"""Marker and colour of each series in a plot."""

BASE = ("·", "#93a4b3")
"""The reference nests on the base."""
