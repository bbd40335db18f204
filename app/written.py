"""Files that are to be written later: whether that can work is asked before the work begins."""

import os
from pathlib import Path

from calib.errors import BadInput


def writable(path: Path) -> Path:
    """Return a path at which a file can be written, as far as can be told without writing it.

    Raises
    ------
    BadInput
        If its folder is missing, is none or may not be written, or if it is a folder itself.
    """
    folder = path.parent
    if not folder.is_dir():
        missing = "is a file" if folder.exists() else "does not exist"
        raise BadInput(
            f"the folder {folder} {missing}: {path.name} could not be written there",
            place=str(path),
            remedy="Make the folder, or name a file in one that is there; nothing was done yet",
        )
    if path.is_dir():
        raise BadInput("this is a folder, not a file", place=str(path), remedy="Name a file in it")
    if not os.access(path if path.exists() else folder, os.W_OK):
        raise BadInput(
            "it may not be written", place=str(path), remedy="Change its rights, or name another"
        )
    return path
