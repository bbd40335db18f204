"""Bring an earlier parameter set back to the controller"""

import asyncio
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from app import answer
from app.show.text_table import text_table

if TYPE_CHECKING:
    from app.jobs.applying import SetsReport


@click.command()
@click.option(
    "--site", "site_file", required=True, type=click.Path(path_type=Path), help="Site file."
)
@click.option(
    "--to", "number", type=int, help="Which set; by default the one before the last apply."
)
@click.option("--list", "only_list", is_flag=True, help="List the sets of this controller.")
@click.option(
    "--accept",
    "take",
    is_flag=True,
    help="Take what the controller holds now as known, and write nothing.",
)
@answer.json_option
def command(
    site_file: Path, number: int | None, only_list: bool, take: bool, as_json: bool
) -> None:
    """Bring back a parameter set that was saved before a change.

    What the controller holds is saved first. The set is written, read back bit for bit, stored,
    loaded again and read back again. It also clears the latch that blocks motion when the
    parameters are unknown.
    """
    from app.files.site import load_site

    if sum((number is not None, only_list, take)) > 1:
        raise click.UsageError("--to, --list and --accept exclude one another")
    data, text = asyncio.run(_run(load_site(site_file), number, only_list, take, as_json))
    answer.show(data, as_json, text)


async def _run(
    site: Any, number: int | None, only_list: bool, take: bool, quiet: bool
) -> tuple[dict[str, Any], str]:
    from app.console import ConsoleFace
    from app.jobs.applying import accept_held, bring_back, known_sets
    from app.session.station import Station

    station = Station(site)
    leave = station.observers.watch(ConsoleFace(lambda *_: None, 0, quiet=quiet).hear)
    try:
        await station.connect()
        if only_list:
            return _listed(known_sets(station))
        if take:
            taken = await accept_held(station)
            text = f"set {taken.accepted} is what the controller holds, and known from now on"
            return taken.to_json(), text
        report = await bring_back(station, number)
    finally:
        leave()
        await station.close()
    back = report.snapshot
    text = f"set {back.number} ({back.why}, {back.taken_utc}) is back in the controller"
    return report.to_json(), text


def _listed(report: "SetsReport") -> tuple[dict[str, Any], str]:
    rows = [
        (
            str(s.number), s.taken_utc, f"{s.checksum:#010x}",
            "in the controller" if report.present(s.number) else "", s.why,
        )
        for s in report.sets
    ]  # fmt: skip
    lines = [text_table(("set", "taken (UTC)", "checksum", "", "why"), rows)] if rows else []
    if report.unknown:
        lines.append(f"PARAMETERS UNKNOWN, motion is blocked: {report.unknown}")
    empty = "no sets yet: nothing was applied to this controller"
    return report.to_json(), "\n".join(lines) or empty
