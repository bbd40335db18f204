"""Every fault of a TOML text at once: reading goes on behind a fault, with a value in its place.

A reader that wants this calls ``TomlTable.parse(..., all_faults=True)``, reads as always, and calls
:meth:`Faults.end` before it uses what it read: what stands in place of a faulty value means
nothing.
"""

import re
from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar, cast

from calib.errors import BadInput

_T = TypeVar("_T")
_Read = TypeVar("_Read", bound=Callable[..., Any])
_LINE = re.compile(r"line (\d+)")


class ManyFaults(BadInput):
    """Several faults of one text, in the order of its lines; ``faults`` holds each."""

    def __init__(self, source: str, faults: list[BadInput]) -> None:
        self.faults = tuple(sorted(faults, key=_line))
        lines = [str(one).removeprefix(f"{source}, ") for one in self.faults]
        what = "\n".join([f"{len(faults)} faults", *(f"  {line}" for line in lines)])
        super().__init__(what, place=source)


class Faults:
    """What was wrong so far; one fault a place, as one may be the reason of the next."""

    def __init__(self, source: str) -> None:
        self._source = source
        self._found: dict[str, BadInput] = {}

    def add(self, fault: BadInput) -> None:
        """Keep a fault, the first of its place."""
        self._found.setdefault(fault.place, fault)

    def attempt(self, read: Callable[[], _T]) -> _T:
        """What ``read`` returns; where it raises, None, which nobody sees once :meth:`end` ends."""
        try:
            return read()
        except BadInput as fault:
            for one in fault.faults if isinstance(fault, ManyFaults) else (fault,):
                self.add(one)
            return cast("_T", None)

    def end(self) -> None:
        """Raise the fault, or all of them."""
        found = list(self._found.values())
        if found:
            raise found[0] if len(found) == 1 else ManyFaults(self._source, found)


def standing_in(value: Callable[..., Any]) -> Callable[[_Read], _Read]:
    """A method that reads a key: where its table keeps faults, ``value`` stands in for a bad one.

    ``value`` takes what the method takes.
    """

    def kept(read: _Read) -> _Read:
        @wraps(read)
        def read_on(self: Any, key: str, *args: Any, **options: Any) -> Any:
            try:
                return read(self, key, *args, **options)
            except BadInput as fault:
                if self.faults is None:
                    raise
                self.faults.add(fault)
                return value(key, *args, **options)

        return cast("_Read", read_on)

    return kept


def some_number(
    key: str,
    default: float | None = None,
    *,
    unit: str = "",
    above: float | None = None,
    least: float = 0.0,
    most: float = 0.0,
) -> float:
    """A number that a reader takes without complaint."""
    if default is not None:
        return default
    return max(above + 1.0 if above is not None else 0.0, least)


def some_numbers(key: str, length: int, default: Any = None, **bounds: Any) -> tuple[float, ...]:
    """As many numbers as were asked for."""
    return tuple(default) if default is not None else (0.0,) * length


def _line(fault: BadInput) -> int:
    found = _LINE.search(fault.place)
    return int(found.group(1)) if found else 0
