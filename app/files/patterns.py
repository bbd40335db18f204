"""Regular expressions that a map holds: none may look at a line for ever.

Python's ``re`` has no deadline, and repeats within repeats can take longer than anybody lives. A
pattern is tried on growing lines when it is read; where the system has a timer of CPU time, each
look has a limit besides; and what is longer than any label or line of a table is not looked at.
"""

import re
import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType

from calib.errors import BadInput
from calib.toml_table import TomlTable
from drivers.lines.patience import slow_on

LONGEST = 4000
"""Signs of a label or line in which a pattern is searched."""
SHORT = 16
"""Signs on which no pattern takes long."""
LIMIT_S = 0.5
"""CPU time of one look; a harmless pattern takes microseconds."""
_SIMPLER = "Write it simpler: no repeat within a repeat, no two ways to read one sign"


def pattern_of(table: TomlTable, key: str) -> str:
    """Read a regular expression; "" where it is missing.

    Raises
    ------
    BadInput
        If it is none, or may take too long.
    """
    text = table.text(key, "")
    if len(text) > LONGEST:
        raise table.wrong(f"{key} has {len(text)} signs", key, remedy=_SIMPLER)
    try:
        compiled = re.compile(text)
    except (re.error, OverflowError, RecursionError) as error:
        raise table.wrong(f"{key} is no pattern: {error}", key) from error
    if text and (slow := slow_on(compiled, anywhere=True)):
        raise table.wrong(f"{key}: {slow}", key, remedy=_SIMPLER)
    return text


def find(pattern: str, text: str, place: str) -> re.Match[str] | None:
    """Search a pattern in a label or a line that stands at ``place``.

    Raises
    ------
    BadInput
        If the text is too long for a label or a line, or the look at it is.
    """
    if len(text) > LONGEST:
        raise BadInput(
            f"{len(text)} signs, in which a pattern is to be searched", place=place,
            remedy=f"A label or line has {LONGEST} at most; see delimiter under [file] of the map",
        )  # fmt: skip
    if len(text) <= SHORT:
        return re.search(pattern, text)
    try:
        with _limited():
            return re.search(pattern, text)
    except _TooLong:
        raise BadInput(
            f"the pattern {pattern!r} takes too long on {text[:40]!r}", place=place, remedy=_SIMPLER
        ) from None


class _TooLong(Exception):
    """The limit of one look is over."""


def _over(_number: int, _frame: FrameType | None) -> None:
    raise _TooLong


@contextmanager
def _limited() -> Iterator[None]:
    """Raise _TooLong in what takes more CPU time; only the main thread can be interrupted so."""
    if (
        not hasattr(signal, "setitimer")
        or threading.current_thread() is not threading.main_thread()
    ):
        yield
        return
    before = signal.signal(signal.SIGVTALRM, _over)
    signal.setitimer(signal.ITIMER_VIRTUAL, LIMIT_S)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_VIRTUAL, 0.0)
        signal.signal(signal.SIGVTALRM, before)
