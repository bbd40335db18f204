"""From the journal to a run on disk: ``run.toml`` and ``points.csv`` (docs: formats)."""

import csv
import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import tomli_w

from app.files.site import Site
from app.session.journal import PARAMETERS, Journal, Row
from app.session.plan import Plan

_SAME = 1e-9


def export_run(site: Site, plan: Plan, journal: Journal, folder: Path) -> Path:
    """Write the run of a session; what is there from an earlier export is replaced.

    Returns the run's folder. Good readings only, in the order in which they were taken; a move
    after which nothing was read stays as a row without a reading, since the next direction of
    approach depends on it.
    """
    folder.mkdir(parents=True, exist_ok=True)
    _replace(folder / "points.csv", points_text(journal.rows(), len(site.machine.actuators)))
    _replace(folder / "run.toml", tomli_w.dumps(_header(site, plan, journal)))
    return folder


def _replace(path: Path, text: str) -> None:
    draft = path.with_suffix(".draft")
    draft.write_text(text, encoding="utf-8", newline="\n")
    draft.replace(path)


def _header(site: Site, plan: Plan, journal: Journal) -> dict[str, Any]:
    held: dict[str, float] = journal.meta(PARAMETERS, {})
    known = site.machine.parameter_index
    header: dict[str, Any] = {
        "format": "pkm-run/1",
        "machine": site.machine_name,
        "title": plan.title,
        "tracker": {"model": site.tracker.model, "reflector": site.tracker.reflector},
        "nests": {
            "platform": {name: list(p) for name, p in site.platform_nests.items()},
            "base": {name: list(p) for name, p in site.base_nests.items()},
        },
    }
    if held:
        header["controller"] = {"parameters": {n: v for n, v in held.items() if n in known}}
        written = {n: v for n, v in held.items() if n not in known and v != 0.0}
        if written:
            header["controller"]["compensation"] = written
    if site.load:
        header["load"] = dict(site.load)
    return header


def points_text(rows: Sequence[Row], actuators: int) -> str:
    """Rows of a journal as the text of ``points.csv``."""
    kept = [row for i, row in enumerate(rows) if row.kind == "reading" or not _read_after(rows, i)]
    channels = sorted({name for row in kept for name in row.channels})
    cycles = any(row.cycle is not None for row in kept)
    names = ["time_s", "pose", "nest", *(f"q{i}" for i in range(1, actuators + 1))]
    names += ["x", "y", "z", "sx", "sy", "sz", "sxy", "sxz", "syz", "delay_s"]
    names += [*(["cycle"] if cycles else []), *channels]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(names)
    latest = 0.0
    for row in kept:
        latest = max(latest, row.time_s)
        cells = [f"{latest:.3f}", row.pose, row.nest, *(f"{value:.9f}" for value in row.q)]
        cells += _reading_cells(row)
        if cycles:
            cells.append("" if row.cycle is None else str(row.cycle))
        cells += [_number(row.channels.get(name)) for name in channels]
        writer.writerow(cells)
    return text.getvalue()


def _reading_cells(row: Row) -> list[str]:
    if row.xyz is None or row.covariance is None:
        return [""] * 10
    xx, yy, zz, xy, xz, yz = row.covariance
    cells = [f"{value:.7f}" for value in row.xyz]
    cells += [f"{math.sqrt(value):.8f}" for value in (xx, yy, zz)]
    cells += [f"{value:.6e}" for value in (xy, xz, yz)]
    return [*cells, _number(row.delay_s)]


def _number(value: float | None) -> str:
    return "" if value is None or not math.isfinite(value) else f"{value:.6g}"


def _read_after(rows: Sequence[Row], index: int) -> bool:
    """Whether something was read where this move led to, before the next move."""
    for row in rows[index + 1 :]:
        if row.kind == "move":
            return False
        if all(abs(a - b) < _SAME for a, b in zip(row.q, rows[index].q, strict=True)):
            return True
    return False
