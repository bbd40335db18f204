"""Whether an answer is as its schema in docs/schemas says; the part of JSON Schema used there."""

import json
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

SCHEMAS = Path(__file__).parents[1] / "docs" / "schemas"
KINDS: dict[str, tuple[type, ...]] = {
    "object": (dict,), "array": (list,), "string": (str,), "boolean": (bool,),
    "null": (type(None),), "integer": (int,), "number": (int, float),
}  # fmt: skip
UNDERSTOOD = {
    "$schema", "title", "description", "type", "properties", "required", "additionalProperties",
    "items", "prefixItems", "minItems", "anyOf", "const",
}  # fmt: skip


@cache
def schemas() -> dict[str, dict[str, Any]]:
    """Every schema by the name of its file."""
    return {
        path.stem: json.loads(path.read_text(encoding="utf-8"))
        for path in sorted(SCHEMAS.glob("*.json"))
    }


def faults_of(answer: Any) -> list[str]:
    """What is wrong with an answer by the schemas of its format; the nearest schema counts."""
    said = answer.get("format") if isinstance(answer, dict) else None
    tried = [
        list(faults(answer, schema))
        for schema in schemas().values()
        if schema["properties"]["format"]["const"] == said
    ]
    return min(tried, key=len) if tried else [f"docs/schemas has none for the format {said!r}"]


def faults(value: Any, schema: dict[str, Any], place: str = "answer") -> Iterator[str]:
    """Where a value is not as a schema says."""
    assert set(schema) <= UNDERSTOOD, set(schema) - UNDERSTOOD
    if "anyOf" in schema:
        yield from min((list(faults(value, one, place)) for one in schema["anyOf"]), key=len)
        return
    if "const" in schema and value != schema["const"]:
        yield f"{place} is {value!r}, not {schema['const']!r}"
    kind = schema.get("type")
    if kind is None:
        return
    if not isinstance(value, KINDS[kind]) or (isinstance(value, bool) and kind != "boolean"):
        yield f"{place} is no {kind}: {value!r}"
    elif kind == "object":
        yield from _object_faults(value, schema, place)
    elif kind == "array":
        first = schema.get("prefixItems", [])
        if len(value) < schema.get("minItems", 0):
            yield f"{place} has {len(value)} items"
        for number, item in enumerate(value):
            own = first[number] if number < len(first) else schema.get("items", {})
            yield from faults(item, own, f"{place}[{number}]")


def _object_faults(value: dict[str, Any], schema: dict[str, Any], place: str) -> Iterator[str]:
    known, others = schema.get("properties", {}), schema.get("additionalProperties", True)
    for key in schema.get("required", []):
        if key not in value:
            yield f"{place} lacks {key}"
    for key, item in value.items():
        if key in known:
            yield from faults(item, known[key], f"{place}.{key}")
        elif others is False:
            yield f"{place} has {key}, of which the schema knows nothing"
        elif others is not True:
            yield from faults(item, others, f"{place}.{key}")
