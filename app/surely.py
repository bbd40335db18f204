"""Writing a file so that it is whole or absent, whatever happens meanwhile."""

import os
import stat
from pathlib import Path

_GROUP = stat.S_IRGRP | stat.S_IWGRP


def write_surely(path: Path, text: str, *, private: bool = False) -> None:
    """Write UTF-8 text: a draft beside the file, flushed to the disk, then put in its place.

    Parameters
    ----------
    private : bool
        Nobody else may read or write it; its group may what its folder lets the group do. Else
        rights are as usual.

    Raises
    ------
    OSError
        The file is then as it was.
    """
    path = Path(os.path.realpath(path))
    if path.exists() and not path.is_file():  # a pipe, a terminal
        path.write_text(text, encoding="utf-8", newline="\n")
        return
    draft = path.with_name(f"{path.name}.draft")
    draft.unlink(missing_ok=True)  # one that a killed process left, or somebody laid there
    flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL
    try:
        handle = os.open(draft, flags, 0o600 if private else 0o666)
        with os.fdopen(handle, "w", encoding="utf-8", newline="\n") as file:
            if private and os.name == "posix":
                os.fchmod(file.fileno(), 0o600 | path.parent.stat().st_mode & _GROUP)
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        draft.replace(path)
    except OSError:
        draft.unlink(missing_ok=True)
        raise
    if os.name == "posix":  # elsewhere a folder cannot be flushed
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
