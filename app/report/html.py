"""A record as one HTML file that needs nothing beside it."""

import base64
from importlib.resources import files
from pathlib import Path

import jinja2
from jinja2.sandbox import SandboxedEnvironment

from app.files.text import read_text
from app.report.logo import logo_of
from app.report.page import Page
from app.templating import compiled
from calib.errors import BadInput

TEMPLATE = "record.html"


def html_of(page: Page, template: str = "") -> str:
    """Set a record by a Jinja template in a sandbox, the shipped one if none is named.

    Raises
    ------
    BadInput
        Naming the template and the line of its fault.
    """
    data, pictures = page.to_data()
    source = read_text(Path(template)) if template else shipped(TEMPLATE)
    environment = SandboxedEnvironment(
        autoescape=True, undefined=jinja2.StrictUndefined, trim_blocks=True, lstrip_blocks=True
    )
    addresses = {name: _address("image/svg+xml", svg.encode()) for name, svg in pictures.items()}
    logo = logo_of(page.logo)
    address = _address(logo.media_type, logo.content) if logo else ""
    try:
        return compiled(environment, source).render(record=data, pictures=addresses, logo=address)
    except (jinja2.TemplateError, ArithmeticError, LookupError, TypeError, ValueError) as error:
        line = getattr(error, "lineno", None)
        place = f"{template or TEMPLATE}{f', line {line}' if line else ''}"
        raise BadInput(
            f"the template cannot be used: {error}",
            place=place,
            remedy="docs/record.md has what it gets",
        ) from error


def shipped(name: str) -> str:
    """Text of a template that ships."""
    return files("app.templates").joinpath(name).read_text(encoding="utf-8")


def _address(media_type: str, content: bytes) -> str:
    return f"data:{media_type};base64,{base64.b64encode(content).decode('ascii')}"
