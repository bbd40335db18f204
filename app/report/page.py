"""A calibration record as plain blocks, which a template sets as HTML or as pages.

What a template gets is the object of :meth:`Page.to_data` (``pkm-record/1``, docs/record.md) and
the pictures beside it as SVG texts.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure

from app.report.figures import as_svg

FORMAT = "pkm-record/1"


@dataclass(frozen=True)
class Text:
    """A paragraph."""

    text: str

    def to_data(self) -> dict[str, Any]:
        """Plain data for a template."""
        return {"kind": "text", "text": self.text}


@dataclass(frozen=True)
class Facts:
    """Names and what is said of each; lines of a value stay lines."""

    rows: tuple[tuple[str, str], ...]

    def to_data(self) -> dict[str, Any]:
        """Plain data for a template; what nobody said is left out."""
        return {"kind": "facts", "rows": [list(row) for row in self.rows if row[1]]}


@dataclass(frozen=True)
class Items:
    """A list of sentences."""

    items: tuple[str, ...]

    def to_data(self) -> dict[str, Any]:
        """Plain data for a template."""
        return {"kind": "items", "items": list(self.items)}


@dataclass(frozen=True)
class Table:
    """Rows of ready text; the first column is words, the others are numbers unless ``words``."""

    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    caption: str = ""
    words: tuple[int, ...] = ()
    """Columns that hold words, beside the first."""

    def to_data(self) -> dict[str, Any]:
        """Plain data for a template."""
        words = [column == 0 or column in self.words for column in range(len(self.heads))]
        return {
            "kind": "table",
            "heads": list(self.heads),
            "rows": [list(row) for row in self.rows],
            "caption": self.caption,
            "words": words,
        }


@dataclass(frozen=True)
class Picture:
    """A figure (SVG) with what it shows in a sentence."""

    svg: str
    caption: str

    @classmethod
    def of(cls, figure: Figure, caption: str) -> "Picture":
        """Draw a matplotlib figure."""
        return cls(as_svg(figure), caption)


@dataclass(frozen=True)
class Verdict:
    """A statement of conformity: ``word`` is PASS or FAIL."""

    word: str
    says: str

    def to_data(self) -> dict[str, Any]:
        """Plain data for a template."""
        return {"kind": "verdict", "word": self.word, "says": self.says}


Block = Text | Facts | Items | Table | Picture | Verdict


@dataclass(frozen=True)
class Section:
    """A heading with its blocks."""

    title: str
    blocks: tuple[Block, ...]


@dataclass(frozen=True)
class Page:
    """A whole record.

    ``head`` stands under the title; ``signatures`` are who is to sign, after the sections and
    before the ``appendices``; ``number`` is on every page; ``logo`` is a file (SVG or PNG), empty
    for none.
    """

    title: str
    number: str
    issued: str
    laboratory: str
    head: Facts
    sections: tuple[Section, ...]
    appendices: tuple[Section, ...] = ()
    signatures: tuple[str, ...] = ()
    footer: str = ""
    logo: str = ""

    def to_data(self) -> tuple[dict[str, Any], dict[str, str]]:
        """Plain data for a template, and the SVG texts of its pictures by their file names."""
        pictures: dict[str, str] = {}

        def plain(sections: tuple[Section, ...]) -> list[dict[str, Any]]:
            return [
                {"title": one.title, "blocks": [_data(block, pictures) for block in one.blocks]}
                for one in sections
            ]

        data = {
            "format": FORMAT,
            "title": self.title,
            "number": self.number,
            "issued": self.issued,
            "laboratory": self.laboratory,
            "head": self.head.to_data()["rows"],
            "sections": plain(self.sections),
            "appendices": plain(self.appendices),
            "signatures": list(self.signatures),
            "footer": self.footer,
        }
        return data, pictures


def _data(block: Block, pictures: dict[str, str]) -> Mapping[str, Any]:
    if not isinstance(block, Picture):
        return block.to_data()
    name = f"picture-{len(pictures) + 1}.svg"
    pictures[name] = block.svg
    return {"kind": "picture", "file": name, "caption": block.caption}
