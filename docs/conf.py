"""How Sphinx makes the documentation's site; ``python3 run.py docs`` calls it.

The whole clone is its source, so that links between Markdown files mean the same here and on a
code host. What Markdown cannot say there (the order of the pages, what docstrings and verbs say)
is added while the site is made: ``site_order.rst`` and the pages in ``docs/made``.
"""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

from pygments.lexers.special import TextLexer
from site_api import readable, short_types, write_pages

HERE = Path(__file__).parent
ORDERS = {
    "README": (HERE / "site_order.rst").read_text(encoding="utf-8"),
    "docs/decisions/README": ".. toctree::\n   :maxdepth: 1\n   :glob:\n\n   0*\n",
}

project = "pkmcal"
html_title = "pkmcal"
root_doc = "README"
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx_click"]
include_patterns = ["*.md", "docs/**", "examples/**.md"]
exclude_patterns = ["docs/site_order.rst", "docs/images/**", "docs/figures/**", ".*", "site"]

myst_heading_anchors = 3
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_default_options = {"members": True, "ignore-module-all": True}
suppress_warnings = ["ref.python"]  # a name that several classes have: any of them will do
add_module_names = False
napoleon_google_docstring = False
napoleon_use_ivar = True
python_maximum_signature_line_length = 88

html_theme = "furo"
html_copy_source = False
html_show_sourcelink = False
html_static_path = ["site_style"]
html_css_files = ["site.css"]
smartquotes = False  # options begin with two hyphens
highlight_language = "none"
toc_object_entries_show_parents = "hide"
pygments_style = "friendly"
pygments_dark_style = "monokai"


def setup(app):
    """Join in while pages are read."""
    write_pages(HERE / "made")
    app.add_lexer("csv", TextLexer)  # pages say that a block is CSV; there is nothing to colour
    app.connect("source-read", _add_order)
    app.connect("autodoc-process-docstring", readable, priority=400)  # before napoleon
    app.connect("autodoc-process-signature", short_types)


def _add_order(app, name, source):
    """The first page says in which order all others come, that of decisions which there are."""
    order = ORDERS.get(name)
    if order is not None:
        source[0] += f"\n```{{eval-rst}}\n{order}\n```\n"
