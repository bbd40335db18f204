"""From files to the page of a calibration, and on to the disk."""

import json
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path

from app.analysis import load_rows
from app.files.text import read_text
from app.report.calibration import Checked, calibration_page
from app.session.plan import Plan
from app.verification import FORMAT
from calib.errors import BadInput
from calib.identify import fit_report
from calib.identify.staged import fit_effects


def write_report(
    runs: tuple[str, ...],
    *,
    add: tuple[str, ...] = (),
    model: Path | None = None,
    before: Path | None = None,
    after: Path | None = None,
    title: str = "",
    out: Path,
) -> None:
    """Fit the runs once more and write the page.

    Parameters
    ----------
    runs : tuple of str
        Run folders.
    add, model
        Effects in the model, as for ``pkmcal fit``.
    before, after : Path, optional
        What ``pkmcal verify --save`` kept.
    title : str
    out : Path
        File to write; its folder is made.

    Raises
    ------
    BadInput
        For runs, models and verifications that cannot be read, and a page that cannot be written.
    """
    rows, effects = load_rows(runs, add, model)
    found = fit_effects(rows, effects)
    said = fit_report(found)
    page = calibration_page(
        title or f"Calibration of {rows.machine.name}",
        found,
        said,
        read_checked(before) if before else None,
        read_checked(after) if after else None,
        f"pkmcal {version('pkmcal')}, {datetime.now(UTC):%Y-%m-%d %H:%M} UTC, "
        f"from {', '.join(runs)}",
    )
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
        out.write_text(page.html(), encoding="utf-8")
    except OSError as error:
        raise BadInput(
            f"cannot write: {error}", place=str(out), remedy="Name another --out."
        ) from error


def read_checked(path: Path) -> Checked:
    """Read what ``verify --save`` kept, and the plan of its session."""
    try:
        found = json.loads(read_text(path))
        if found["format"] != FORMAT:
            raise ValueError(f"format {found['format']!r}")
        plan_file = Path(found["session"]) / "plan.json"
    except (ValueError, KeyError, TypeError) as error:
        raise BadInput(
            f"not a saved verification ({error})", place=str(path), remedy="pkmcal verify --save"
        ) from error
    return Checked(found, Plan.from_json(read_text(plan_file), str(plan_file)).poses)
