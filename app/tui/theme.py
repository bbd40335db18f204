"""The screens' colours: calm, high contrast, and never the only carrier of a meaning.

A theme is made for areas of its colours: as text on a light ground its amber or its green cannot be
read. Text has inks: the same colours, made darker or lighter until they stand out.
"""

from collections.abc import Mapping

from textual.app import App
from textual.color import BLACK, WHITE, Color, ColorParseError
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
"""Roles that themes do not have."""

INKED = ("primary", "secondary", "accent", "success", "warning", "error")
GROUNDS = ("background", "surface", "panel")
KEYS = ("footer-key-foreground",)
"""Texts that Textual colours by itself."""
CONTRAST = 4.5
"""Of text against its ground, at least: WCAG 2.2, 1.4.3."""


def with_inks(variables: Mapping[str, str]) -> dict[str, str]:
    """Add ``ink-accent`` and so on, for text, to the colours of a theme by name."""
    grounds = [Color.parse(variables[name]) for name in GROUNDS]
    roles = {name: variables[name] for name in INKED} | FIXED
    inks = {f"ink-{name}": _ink(colour, grounds) for name, colour in roles.items()}
    for name in KEYS:
        inks[name] = _ink(variables.get(name, variables["accent"]), grounds)
    return {**variables, **inks}


def _ink(colour: str, grounds: list[Color]) -> str:
    """The colour, moved to black or white until it can be read on each of the grounds."""
    try:
        ink = Color.parse(colour)
    except ColorParseError:
        return colour
    if ink.ansi is not None or any(ground.ansi is not None for ground in grounds):
        return colour  # the terminal's own, whatever they are
    end = max((BLACK, WHITE), key=lambda one: min(contrast(one, ground) for ground in grounds))
    parts = (part / 20.0 for part in range(21))
    shades = (ink.blend(end, part) for part in parts)
    return next(
        (
            shade.hex
            for shade in shades
            if all(contrast(shade, ground) >= CONTRAST for ground in grounds)
        ),
        end.hex,
    )


def contrast(one: Color, other: Color) -> float:
    """How far two colours stand apart: 1 to 21 (WCAG 2.2)."""
    bright, dark = sorted((_luminance(one), _luminance(other)), reverse=True)
    return (bright + 0.05) / (dark + 0.05)


def _luminance(colour: Color) -> float:
    """Relative luminance of an sRGB colour."""
    linear = (
        part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4
        for part in colour.normalized
    )
    return sum(weight * part for weight, part in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def tinted(app: App[object], style: str) -> str:
    """A style with the present theme's inks in place of roles: ``bold error``."""
    return " ".join(_colour(app, word) for word in style.split())


def _colour(app: App[object], word: str) -> str:
    theme = app.current_theme
    if word == "foreground":
        found = theme.foreground or ("#dbe2e8" if theme.dark else "#1b232a")
    elif f"ink-{word}" in app.theme_variables:
        found = app.theme_variables[f"ink-{word}"]
    elif word in INKED:
        found = getattr(theme, word) or theme.primary
    else:
        found = FIXED.get(word, word)
    return str(found).removeprefix("ansi_")
