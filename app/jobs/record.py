"""Records that are declared once: typed fields for scripts, read from an answer's plain data."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields
from types import NoneType, UnionType
from typing import Any, ClassVar, Self, get_args, get_origin, get_type_hints

from app.plain_data import plain


@dataclass(frozen=True, kw_only=True)
class Record:
    """A record whose fields are the keys of a JSON object; ``from_`` is the key ``from``.

    The entries of the mapping ``FLAT`` lie beside the other keys there.
    """

    FLAT: ClassVar[str] = ""

    @classmethod
    def of(cls, table: Mapping[str, Any], **beside: Any) -> Self:
        """Read a record, and the records in it, from plain data.

        ``beside`` are fields that are no part of the data; their names begin with ``_``.

        Raises
        ------
        TypeError
            If the table has a key that is not declared, or lacks one: a fault of the program.
        """
        hints = get_type_hints(cls)
        names = {f.name.rstrip("_"): f.name for f in fields(cls) if not f.name.startswith("_")}
        strange = set(table) - set(names)
        if strange:
            raise TypeError(f"{cls.__name__} has no field {', '.join(sorted(strange))}")
        said = {names[key]: _read(hints[names[key]], value) for key, value in table.items()}
        return cls(**said, **beside)


@dataclass(frozen=True, kw_only=True)
class Report(Record):
    """What a verb answers: its fields typed, and :meth:`to_json` as ``--json`` prints it."""

    FORMAT: ClassVar[str]
    _said: Mapping[str, Any] = field(repr=False, compare=False)

    @classmethod
    def of(cls, table: Mapping[str, Any], **beside: Any) -> Self:
        """Read a report from the answer of its verb; raises TypeError as :meth:`Record.of`."""
        said: dict[str, Any] = plain(table)
        if said.get("format") != cls.FORMAT:
            raise TypeError(f"{said.get('format')!r} is no {cls.FORMAT}")
        known = {key: value for key, value in said.items() if key != "format"}
        return super().of(known, _said=said, **beside)

    def to_json(self) -> dict[str, Any]:
        """Plain data: the object that ``--json`` prints. Numbers that are not finite are None."""
        return dict(self._said)


def _read(kind: Any, value: Any) -> Any:
    """Read one value as its declared kind."""
    if value is None:
        return None
    origin, inner = get_origin(kind), get_args(kind)
    if origin is UnionType:
        return _read(next(one for one in inner if one is not NoneType), value)
    if origin is tuple:
        kinds = inner[:1] * len(value) if inner[-1] is Ellipsis else inner
        return tuple(_read(one, item) for one, item in zip(kinds, value, strict=True))
    if origin is not None and issubclass(origin, Mapping):
        return {key: _read(inner[1], item) for key, item in value.items()}
    if isinstance(kind, type) and issubclass(kind, Record):
        return kind.of(value)
    return float(value) if kind is float else value
