"""Whoever follows a pointer of code or documentation arrives somewhere."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOLDERS = ("app", "bench", "calib", "docs", "drivers", "examples", "mocks", "pkmcal", "tests")
HERE = Path(__file__)
SOURCES = sorted(
    path
    for folder in FOLDERS
    for path in (ROOT / folder).rglob("*")
    if path.suffix in (".py", ".md", ".toml", ".csv", ".html") and path != HERE
)
SOURCES += [*ROOT.glob("*.md"), *ROOT.glob("*.py"), ROOT / "pyproject.toml"]

PAGE = re.compile(r"(?<![\w*{])[\w./-]+\.md\b")
ELSEWHERE = re.compile(r"\bseeds?/|\(seeds\b|\breading notes\b|\bthe notes\b", re.IGNORECASE)
LINK = re.compile(r"\]\(([^)#\s]+)(?:#[^)]*)?\)")
WRITTEN = {"reproduction.md"}
"""Pages that the program writes wherever it is told to."""


def text_of(path: Path) -> str:
    return path.read_text(encoding="utf-8", errors="replace")


def test_pages_that_are_named_are_there():
    names = {page.name for page in ROOT.glob("*.md")} | {
        str(page.relative_to(start))
        for start in (ROOT, ROOT / "docs", ROOT / "docs" / "protocols", ROOT / "docs" / "decisions")
        for page in start.rglob("*.md")
        if ".venv" not in page.parts
    }
    lost = [
        f"{path.relative_to(ROOT)}: {name}"
        for path in SOURCES
        for name in PAGE.findall(text_of(path))
        if name not in names | WRITTEN and not (path.parent / name).exists()
    ]
    assert not lost


def test_nothing_points_to_texts_that_are_not_in_the_repository():
    assert [
        str(path.relative_to(ROOT)) for path in SOURCES if ELSEWHERE.search(text_of(path))
    ] == []


@pytest.mark.parametrize(
    "page", [p for p in SOURCES if p.suffix == ".md"], ids=lambda p: str(p.relative_to(ROOT))
)
def test_links_between_pages_arrive(page: Path):
    links = [link for link in LINK.findall(text_of(page)) if "://" not in link]
    assert [link for link in links if not (page.parent / link).exists()] == []
