"""The laboratory's logo: SVG or PNG, read and checked."""

from dataclasses import dataclass
from pathlib import Path

from calib.errors import BadInput


@dataclass(frozen=True)
class Logo:
    """``name`` is that of the file which a template of pages includes."""

    name: str
    media_type: str
    content: bytes


def logo_of(path: str) -> Logo | None:
    """Read a logo; None for an empty path.

    Raises
    ------
    BadInput
        If the file cannot be read, or is neither SVG nor PNG.
    """
    if not path:
        return None
    try:
        content = Path(path).read_bytes()
    except OSError as error:
        raise BadInput(f"cannot read: {error}", place=path, remedy="Mend record.logo") from error
    if content.startswith(b"\x89PNG\r\n"):
        return Logo("logo.png", "image/png", content)
    if b"<svg" in content[:4096]:
        return Logo("logo.svg", "image/svg+xml", content)
    raise BadInput("neither SVG nor PNG", place=path, remedy="Give the logo as one of them")
