"""Signs for terminals that have no others than ASCII: one for one, so that nothing moves."""

import unicodedata
from collections.abc import Mapping

from app.show.braille import shade

SIGNS = {
    "✓": "+", "✗": "X", "▶": ">", "▸": ">", "·": ".", "●": "*", "○": "o", "■": "#", "‖": "=",
    "…": "~", "–": "-", "—": "-", "−": "-", "→": ">", "≤": "<", "±": "~", "°": "'", "µ": "u",
    "²": "2", "█": "#", "▓": "#", "▒": ":", "░": ".", "▔": "-", "▀": "-", "▁": "_", "▄": "_",
    "╷": "|", "╵": "|",
}  # fmt: skip
"""What stands for each sign of the screens; lines and corners of boxes are found by their names."""


def only_ascii(environment: Mapping[str, str]) -> bool:
    """Whether the terminal is said to have no other signs: by its kind, or by the locale.

    The first of LC_ALL, LC_CTYPE and LANG that says something counts. Python itself writes
    ``LC_CTYPE=C.UTF-8`` where the locale is C (PEP 538): that says nothing of the terminal. Where
    nothing is said the terminal is taken for one of today.
    """
    if environment.get("TERM") == "dumb":
        return True
    for name in ("LC_ALL", "LC_CTYPE", "LANG"):
        said = environment.get(name, "").upper()
        if said and not (name == "LC_CTYPE" and said == "C.UTF-8"):
            return said in ("C", "POSIX") or ("." in said and "UTF" not in said)
    return False


def in_ascii(text: str) -> str:
    """The same text, sign for sign, in ASCII."""
    return text if text.isascii() else "".join(map(_sign, text))


def _sign(sign: str) -> str:
    if sign.isascii():
        return sign
    if sign in SIGNS:
        return SIGNS[sign]
    if "\u2800" <= sign <= "\u28ff":
        return shade(sign)
    if "\u2500" <= sign <= "\u259f":
        return _line(unicodedata.name(sign))
    plain = unicodedata.normalize("NFKD", sign)[0]
    return plain if plain.isascii() else "?"


def _line(name: str) -> str:
    """A part of a box or a block, by its name."""
    across = "HORIZONTAL" in name or "UPPER" in name or "LOWER" in name
    upright = "VERTICAL" in name or "LEFT" in name or "RIGHT" in name
    if across and not upright:
        return "-"
    return "|" if upright and not across and "AND" not in name else "+"
