"""JSON Schema (2020-12) of an answer, derived from the fields of its record."""

from collections.abc import Mapping
from dataclasses import MISSING, fields
from types import NoneType, UnionType
from typing import Any, get_args, get_origin, get_type_hints

from app.jobs.record import Record, Report

_SIMPLE = {float: "number", int: "integer", str: "string", bool: "boolean"}


def schema_of(report: type[Report]) -> dict[str, Any]:
    """Schema of what a verb prints with ``--json``: nothing more, and nothing less."""
    found = _of_record(report)
    found["properties"] = {"format": {"const": report.FORMAT}, **found["properties"]}
    found["required"] = ["format", *found["required"]]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": report.FORMAT,
        "description": _says(report),
        **found,
    }


def _of_record(record: type[Record]) -> dict[str, Any]:
    hints = get_type_hints(record)
    own = [field for field in fields(record) if not field.name.startswith("_")]
    beside = _of(hints[record.FLAT])["additionalProperties"] if record.FLAT else False
    own = [field for field in own if field.name != record.FLAT]
    optional = {f.name for f in own if f.default is not MISSING or f.default_factory is not MISSING}
    return {
        "type": "object",
        "properties": {field.name.rstrip("_"): _of(hints[field.name]) for field in own},
        "required": [field.name.rstrip("_") for field in own if field.name not in optional],
        "additionalProperties": beside,
    }


def _of(kind: Any) -> dict[str, Any]:
    origin, inner = get_origin(kind), get_args(kind)
    if origin is UnionType:
        return {"anyOf": [{"type": "null"}, *(_of(one) for one in inner if one is not NoneType)]}
    if origin is tuple:
        if inner[-1] is Ellipsis:
            return {"type": "array", "items": _of(inner[0])}
        return {"type": "array", "prefixItems": [_of(one) for one in inner], "minItems": len(inner)}
    if origin is not None and issubclass(origin, Mapping):
        return {"type": "object", "additionalProperties": _of(inner[1])}
    if isinstance(kind, type) and issubclass(kind, Record):
        return _of_record(kind)
    return {"type": _SIMPLE[kind]} if kind in _SIMPLE else {}


def _says(report: type[Report]) -> str:
    return " ".join((report.__doc__ or "").split("\n\n")[0].replace("``", "").split())
