"""Make the documentation's site in ``site``: a warning is an error, and nothing comes from outside.

python docs/build_site.py        (python3 run.py docs installs what it needs, and calls it)

Labs are often offline, so no page may load a font, a script, a style or a picture from anywhere.
"""

import re
import sys
from pathlib import Path

from sphinx.cmd.build import build_main

DOCS = Path(__file__).resolve().parent
ROOT = DOCS.parent
SITE = ROOT / "site"

LOADED = re.compile(
    r"""<(?:script|img|iframe|link(?![^>]*rel="(?:canonical|author|license)"))\b[^>]*"""
    r"""(?:src|href)=["'](?:https?:)?//[^"']*|url\(["']?(?:https?:)?//[^)]*|@import\s[^;]*//[^;]*""",
    re.IGNORECASE,
)
FIRST_PAGE = """<!doctype html>
<meta charset="utf-8">
<meta http-equiv="refresh" content="0; url=README.html">
<title>pkmcal</title>
<a href="README.html">pkmcal</a>
"""


def from_outside(site: Path) -> list[str]:
    """What the site's pages, styles and pictures would load from elsewhere, each with its file."""
    return [
        f"{path.relative_to(site)}: {found}"
        for path in sorted(site.rglob("*"))
        if path.suffix in (".html", ".css", ".svg")
        for found in LOADED.findall(path.read_text(encoding="utf-8"))
    ]


def main() -> int:
    """Build the site; exit code 1 if anything is not as it should be."""
    folders = ("-c", str(DOCS), "-d", str(SITE / ".doctrees"), str(ROOT), str(SITE))
    failed = build_main(["-q", "-W", "--keep-going", "-E", "-j", "auto", "-b", "html", *folders])
    if failed:
        return 1
    (SITE / "index.html").write_text(FIRST_PAGE, encoding="utf-8")
    outside = from_outside(SITE)
    print("\n".join([*outside, f"{len(list(SITE.rglob('*.html')))} pages in {SITE}/index.html"]))
    return 1 if outside else 0


if __name__ == "__main__":
    sys.exit(main())
