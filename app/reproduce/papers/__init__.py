"""The papers' own numbers, as data."""

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any


@cache
def paper(name: str) -> dict[str, Any]:
    """Numbers of ``han``, ``feng`` or ``zhang``."""
    text = files(__name__).joinpath(f"{name}.toml").read_text(encoding="utf-8")
    return tomllib.loads(text)
