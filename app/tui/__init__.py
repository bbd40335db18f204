"""The screens: ``pkmcal`` without a verb. :func:`run` opens them."""

from pathlib import Path


def run(site: Path | None = None, *, root: Path = Path("sessions")) -> None:
    """Open the screens, with a site file if one is named; sessions get folders under ``root``."""
    from app.tui.program import Workbench

    Workbench(site, root=root, ends_on_signals=True).run()
