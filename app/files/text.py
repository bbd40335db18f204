"""Reading text files: the one way in for everything that people and other programs wrote."""

from pathlib import Path

from calib.errors import BadInput
from calib.plain_text import plain


def read_text(path: Path) -> str:
    """Read UTF-8 text without its byte order mark, every line ended by a line feed.

    Raises
    ------
    BadInput
        Naming the file, and the line where it is not UTF-8.
    """
    try:
        raw = path.read_bytes()
    except FileNotFoundError:
        raise BadInput(
            "the file is missing", place=str(path), remedy="Check its name and folder"
        ) from None
    except IsADirectoryError:
        raise BadInput(
            "this is a folder, not a file", place=str(path), remedy="Name a file in it"
        ) from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or str(error)
        raise BadInput(reason, place=str(path), remedy="Name a file that can be read") from error
    try:
        return plain(raw.decode("utf-8"))
    except UnicodeDecodeError as error:
        line = raw[: error.start].count(b"\n") + 1
        raise BadInput(
            f"byte 0x{raw[error.start]:02x} is not UTF-8 text",
            place=f"{path}, line {line}",
            remedy="Expected plain UTF-8; save the file again as UTF-8",
        ) from error
