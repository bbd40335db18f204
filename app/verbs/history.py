"""What became of each machine: sets, fits, verifications, what changed, where it drifts"""

from pathlib import Path
from typing import TYPE_CHECKING

import click

from app import answer
from app.report.history_words import drift_words
from app.report.words import with_uncertainty
from app.show.clocks import clock
from app.show.text_table import text_table

if TYPE_CHECKING:
    from app.jobs.looking_back import MachineEntry, SeriesEntry


@click.command()
@click.option(
    "--folder", default="sessions", type=click.Path(path_type=Path), help="Where sessions are."
)
@click.option("--serial", default="", help="Only the machine with this controller.")
@click.option("--all", "everything", is_flag=True, help="Every parameter, not only what changed.")
@click.option(
    "--site",
    "site_file",
    type=click.Path(path_type=Path),
    help="Site file whose record.tolerance_um is what the forecast runs into.",
)
@click.option(
    "--tolerance-um",
    type=click.FloatRange(0.0, min_open=True),
    help="The same as a number.",
)
@answer.json_option
def command(
    folder: Path,
    serial: str,
    everything: bool,
    site_file: Path | None,
    tolerance_um: float | None,
    as_json: bool,
) -> None:
    """Look back on the machines whose sessions lie in a folder.

    Every set that was applied, every fit of a session's run and every finished verification is
    kept there. What changed between the last two calibrations is judged over all parameters
    together (family-wise p below 0.05); with three or more, a drift and where it leads.
    """
    from app.files.site import load_site
    from app.jobs.looking_back import history_of

    if tolerance_um is None and site_file is not None:
        tolerance_um = load_site(site_file).record.tolerance_um
    found = history_of(folder, serial=serial, tolerance_um=tolerance_um)
    text = "\n\n".join(words(machine, everything) for machine in found.machines)
    answer.show(found.to_json(), as_json, text or f"no history in {folder}")


def words(machine: "MachineEntry", everything: bool = False) -> str:
    """One machine as text: events, then parameters, then what is to be expected."""
    name = f"{machine.machine} {machine.serial}".strip()
    lines = [name, *(f"  {clock(e.utc)}  {e.kind:12}  {e.says}" for e in machine.events)]
    count = max((len(one.values) for one in machine.parameters), default=0)
    if count > 1:
        shown = [one for one in machine.parameters if everything or one.changed]
        rows = [_row(one) for one in shown if one.change is not None]
        said = f"  {count} calibrations; changed more than chance between the last two:"
        lines += ["", f"{said} {'' if rows else 'nothing'}".rstrip()]
        if rows:
            heads = ("  parameter", "before", "now", "change", "sigma", "unit", "p")
            lines.append(text_table(heads, rows))
    for one in (*machine.parameters, *((machine.errors,) if machine.errors else ())):
        if one.drift is not None and (one.drift.clear or everything):
            lines.append(f"  {one.name} moves {drift_words(one.drift, one.unit)}")
    return "\n".join(lines)


def _row(one: "SeriesEntry") -> tuple[str, ...]:
    assert one.change is not None
    assert one.change_sigma is not None
    assert one.p_value is not None
    change, sigma = with_uncertainty(one.change, one.change_sigma)
    return (
        f"  {one.name}", with_uncertainty(one.values[-2], one.sigmas[-2])[0],
        with_uncertainty(one.values[-1], one.sigmas[-1])[0], change, sigma, one.unit,
        f"{one.p_value:.1g}",
    )  # fmt: skip
