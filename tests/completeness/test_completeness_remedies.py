"""Whoever is refused is told what to do: every refusal of a file or an argument has a remedy."""

import ast
from pathlib import Path

ROOT = Path(__file__).parents[2]


def bare(file: Path) -> list[str]:
    """Where a file raises BadInput without a remedy."""
    calls = [node for node in ast.walk(ast.parse(file.read_text("utf-8"))) if _refuses(node)]
    return [f"{file.relative_to(ROOT)}:{call.lineno}" for call in calls]


def _refuses(node: ast.AST) -> bool:
    if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name)):
        return False
    said = {keyword.arg for keyword in node.keywords}
    return node.func.id == "BadInput" and not said & {"remedy", None}


def test_every_refusal_has_a_remedy() -> None:
    files = [file for root in ("app", "calib") for file in (ROOT / root).rglob("*.py")]
    assert len(files) > 200
    assert [place for file in files for place in bare(file)] == []
