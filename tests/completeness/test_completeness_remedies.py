"""Whoever is refused is told what to do: files, arguments and devices end with place and remedy."""

import ast
from collections.abc import Iterator
from pathlib import Path

import drivers.errors

ROOT = Path(__file__).parents[2]
FAULTS = {
    name for name, kind in vars(drivers.errors).items()
    if isinstance(kind, type) and issubclass(kind, drivers.errors.DeviceError)
}  # fmt: skip
PARSERS = {"drivers/emscon/framing.py", "drivers/emscon/wire.py"}
"""These do not know whose bytes they take apart; their link says it."""


def lacking(file: Path, names: set[str], wanted: tuple[str, ...]) -> Iterator[str]:
    """Where a file makes one of these errors without a keyword that it should have."""
    for node in ast.walk(ast.parse(file.read_text("utf-8"))):
        if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name)):
            continue
        said = {keyword.arg for keyword in node.keywords}
        if node.func.id in names and None not in said and (left := set(wanted) - said):
            yield f"{file.relative_to(ROOT)}:{node.lineno} {' and '.join(sorted(left))}"


def test_every_refusal_has_a_remedy() -> None:
    files = [file for root in ("app", "calib") for file in (ROOT / root).rglob("*.py")]
    assert len(files) > 200
    assert [one for file in files for one in lacking(file, {"BadInput"}, ("remedy",))] == []


def test_every_fault_of_a_device_names_it_and_a_remedy() -> None:
    files = [file for root in ("app", "drivers") for file in (ROOT / root).rglob("*.py")]
    found = []
    for file in files:
        knows = str(file.relative_to(ROOT).as_posix()) not in PARSERS
        found += lacking(file, FAULTS, ("device", "remedy") if knows else ("remedy",))
    assert found == []
