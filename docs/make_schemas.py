"""Write docs/schemas: a JSON Schema for every report that a verb answers with ``--json``.

python docs/make_schemas.py

Those of answers without a typed report are kept by hand in the same folder.
"""

import importlib
import json
import pkgutil
from collections.abc import Iterator
from pathlib import Path

import app.jobs
from app.jobs.record import Report
from app.jobs.schema import schema_of

SCHEMAS = Path(__file__).parent / "schemas"


def reports() -> list[type[Report]]:
    """Every report that the program declares, by name."""
    for module in pkgutil.iter_modules(app.jobs.__path__):
        importlib.import_module(f"app.jobs.{module.name}")
    return sorted(_below(Report), key=lambda report: report.__name__)


def _below(report: type[Report]) -> Iterator[type[Report]]:
    for one in report.__subclasses__():
        if "FORMAT" in vars(one) and one.__module__.startswith("app."):
            yield one
        yield from _below(one)


def text_of(report: type[Report]) -> str:
    """The file of a report's schema."""
    return json.dumps(schema_of(report), indent=1) + "\n"


if __name__ == "__main__":
    for each in reports():
        (SCHEMAS / f"{each.__name__}.json").write_text(text_of(each), encoding="utf-8")
