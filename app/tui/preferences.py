"""What an operator likes, kept between starts: the theme. An unreadable file is no fault."""

import contextlib
import json
from pathlib import Path

from app.ownership import state_folder


def _file() -> Path:
    return state_folder() / "screens.json"


def kept_theme() -> str:
    """The theme that was chosen last; empty if none was."""
    with contextlib.suppress(OSError, ValueError):
        kept = json.loads(_file().read_text(encoding="utf-8"))
        if isinstance(kept, dict):
            return str(kept.get("theme", ""))
    return ""


def keep_theme(name: str) -> None:
    """Keep a theme; where nothing can be written the next start has the usual one."""
    with contextlib.suppress(OSError):
        _file().parent.mkdir(parents=True, exist_ok=True)
        _file().write_text(json.dumps({"theme": name}) + "\n", encoding="utf-8")
