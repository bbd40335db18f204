"""Bring an earlier parameter set back to the controller"""

import asyncio
from pathlib import Path
from typing import Any

import click

from app import answer
from app.console import ConsoleFace
from app.files.site import load_site
from app.session.known import Snapshot, Snapshots
from app.session.station import Station
from app.writeback.procedure import accept, undo
from app.writeback.transfer import snapshots_of
from calib.errors import BadInput


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
    if sum((number is not None, only_list, take)) > 1:
        raise click.UsageError("--to, --list and --accept exclude one another")
    data, text = asyncio.run(_run(load_site(site_file), number, only_list, take, as_json))
    answer.show(data, as_json, text)


async def _run(
    site: Any, number: int | None, only_list: bool, take: bool, quiet: bool
) -> tuple[dict[str, Any], str]:
    station = Station(site)
    leave = station.observers.watch(ConsoleFace(lambda *_: None, 0, quiet=quiet).hear)
    try:
        await station.connect()
        snapshots = snapshots_of(station)
        if only_list:
            return _listed(snapshots)
        if take:
            saved = await accept(station)
            text = f"set {saved.number} is what the controller holds, and known from now on"
            return {"format": "pkm-undo/1", "accepted": saved.number}, text
        chosen = snapshots.get(number) if number is not None else _before_last(snapshots)
        back = await undo(station, chosen, f"undo to {chosen.number}")
    finally:
        leave()
        await station.close()
    text = f"set {back.number} ({back.why}, {back.taken_utc}) is back in the controller"
    return {"format": "pkm-undo/1", "restored": back.number}, text


def _before_last(snapshots: Snapshots) -> Snapshot:
    """The set that was saved before the last apply."""
    before = [s for s in snapshots.all() if s.why.startswith("before applying")]
    if not before:
        raise BadInput(
            "nothing was applied to this controller",
            place=str(snapshots.folder),
            remedy="Name a set with --to; --list shows them",
        )
    return before[-1]


def _listed(snapshots: Snapshots) -> tuple[dict[str, Any], str]:
    sets = snapshots.all()
    expected = snapshots.expected()
    rows = [
        (
            str(s.number), s.taken_utc, f"{s.checksum:#010x}",
            "in the controller" if expected and expected.values == s.values else "", s.why,
        )
        for s in sets
    ]  # fmt: skip
    data = {
        "format": "pkm-undo/1",
        "sets": [
            {"number": s.number, "taken_utc": s.taken_utc, "why": s.why, "checksum": s.checksum}
            for s in sets
        ],
        "unknown": snapshots.unknown(),
    }
    lines = [answer.table(("set", "taken (UTC)", "checksum", "", "why"), rows)] if rows else []
    if snapshots.unknown():
        lines.append(f"PARAMETERS UNKNOWN, motion is blocked: {snapshots.unknown()}")
    return data, "\n".join(lines) or "no sets yet: nothing was applied to this controller"
