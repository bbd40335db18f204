"""The page that sets every number of the papers beside ours."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import matplotlib as mpl
from matplotlib.figure import Figure

from app.reproduce.feng import Feng, feng_rows
from app.reproduce.figures_han import han_figures
from app.reproduce.figures_others import feng_figures, zhang_figures
from app.reproduce.han import Han
from app.reproduce.han_rows import han_rows
from app.reproduce.rows import Row
from app.reproduce.zhang import Zhang, zhang_rows

PAPERS: dict[str, tuple[str, Any, Any, Any]] = {
    "han": (
        "Han et al. 2020: calibration of a 6RRRPRR hexapod, complete error model (`hexapod`)",
        Han, han_rows, han_figures,
    ),
    "feng": (
        "Feng et al. 2022: calibration of a 3-PR(4R)R tripod (`tripod`)",
        Feng, feng_rows, feng_figures,
    ),
    "zhang": (
        "Zhang et al. 2018: error analysis of an over-constrained tracking mechanism (`ptm`)",
        Zhang, zhang_rows, zhang_figures,
    ),
}  # fmt: skip
"""Paper -> title, study, rows, figures."""

_HEAD = """# The numbers of the three papers, and ours

Written by `pkmcal reproduce`; nothing here is typed by hand but the papers' own numbers
(`app/reproduce/papers/*.toml`). Verdicts:

- **reached**: ours agrees with theirs within rounding, or within the spread of a simulation;
- **better**: an error of ours is smaller than theirs;
- **not reachable**: theirs does not follow from what is printed; the last column says why.

Seeds are fixed, so the page is the same on every machine but for rounding.
"""


def write_page(names: list[str], folder: Path) -> Iterator[str]:
    """Write ``reproduction.md`` and its figures; yields a line for each paper when it is done.

    Parameters
    ----------
    names : list of str
        Keys of :data:`PAPERS`.
    folder : Path
        The page goes there, figures into ``figures/reproduction`` below.
    """
    pictures = folder / "figures" / "reproduction"
    pictures.mkdir(parents=True, exist_ok=True)
    parts = [_HEAD]
    for name in names:
        title, study_of, rows_of, figures_of = PAPERS[name]
        study = study_of()
        rows: list[Row] = rows_of(study)
        counts = Counter(row.verdict for row in rows)
        told = ", ".join(f"{count} {verdict}" for verdict, count in sorted(counts.items()))
        parts += [f"\n## {title}\n", f"{len(rows)} rows: {told}.\n", table(rows)]
        for key, caption, figure in figures_of(study):
            save(figure, pictures / f"{key}.png")
            parts.append(f"\n![{caption}](figures/reproduction/{key}.png)\n\n{caption}.\n")
        yield f"{name}: {told}"
    (folder / "reproduction.md").write_text("\n".join(parts), encoding="utf-8", newline="\n")


def save(figure: Figure, path: Path) -> None:
    """Save a figure without the time of day in it."""
    with mpl.rc_context({"font.size": 9}):
        figure.savefig(path, dpi=110, metadata={"Software": None})


def table(rows: list[Row]) -> str:
    """Rows as a table in Markdown."""
    lines = [
        "| where | what | theirs | ours | unit | verdict | remark |",
        "|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        cells = (row.where, row.what, row.theirs, row.ours, row.unit, row.verdict, row.because)
        lines.append("| " + " | ".join(cell.replace("|", "/") for cell in cells) + " |")
    return "\n".join(lines) + "\n"
