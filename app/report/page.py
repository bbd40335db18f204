"""A report as a list of sections, and its rendering to one self-contained HTML file."""

from dataclasses import dataclass, field
from importlib.resources import files

import jinja2
from matplotlib.figure import Figure

from app.report.figures import as_data_address


@dataclass(frozen=True)
class Table:
    """Rows of ready text; ``folded`` is the line behind which a long table hides."""

    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    folded: str = ""


@dataclass(frozen=True)
class Picture:
    """A figure with what it shows in one sentence."""

    address: str
    caption: str

    @classmethod
    def of(cls, figure: Figure, caption: str) -> "Picture":
        """Render a matplotlib figure."""
        return cls(as_data_address(figure), caption)


@dataclass(frozen=True)
class Section:
    """A heading with text, tables and pictures."""

    title: str
    text: str = ""
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()


@dataclass(frozen=True)
class Page:
    """A whole report."""

    title: str
    lead: str
    sections: tuple[Section, ...]
    footer: str = field(default="")

    def html(self) -> str:
        """The page as HTML that needs nothing beside it."""
        source = files("app.templates").joinpath("report.html").read_text(encoding="utf-8")
        environment = jinja2.Environment(
            autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True
        )
        return environment.from_string(source).render(
            title=self.title, lead=self.lead, sections=self.sections, footer=self.footer
        )
