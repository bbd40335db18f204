"""A record as pages (PDF/A), set by Typst; no browser and nothing of the system is needed."""

import json
from importlib import import_module
from pathlib import Path
from typing import Any

from app.files.text import read_text
from app.report.html import shipped
from app.report.logo import logo_of
from app.report.page import Page
from calib.errors import BadInput

TEMPLATE = "record.typ"


def pdf_of(page: Page, template: str = "") -> bytes:
    """Set a record by a Typst template, the shipped one if none is named.

    Raises
    ------
    BadInput
        Naming the template and what the typesetter says; or if Typst is not installed.
    """
    try:
        typst: Any = import_module("typst")
    except ImportError as error:
        raise BadInput(
            "pages need the package typst, which is not installed",
            place=str(error),
            remedy="pip install typst, or name an --out that ends in .html",
        ) from error
    data, pictures = page.to_data()
    source = read_text(Path(template)) if template else shipped(TEMPLATE)
    logo = logo_of(page.logo)
    data["logo"] = logo.name if logo else ""
    files = {
        "main": source.encode(),
        "record.json": json.dumps(data).encode(),
        **{name: svg.encode() for name, svg in pictures.items()},
        **({logo.name: logo.content} if logo else {}),
    }
    try:
        # An archive's standard asks things of a template that a lab's own need not keep.
        standards = [] if template else ["a-2b"]
        pages: bytes = typst.compile(files, format="pdf", pdf_standards=standards)
    except typst.TypstError as error:
        raise BadInput(
            f"the template cannot be used: {str(error.diagnostic).strip() or error.message}",
            place=template or TEMPLATE,
            remedy="docs/record.md has what it gets",
        ) from error
    return pages
